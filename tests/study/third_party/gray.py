"""What a search can see at best: every effect of the list at every port, with the machine's own equations (truth.c) and
nothing of the library.

    python gray.py CASES [--only REGEX] [--sample N]

Each candidate is fitted alone to the estimation records of a case, on messy machines together with all declared
parameters, which are linearized and held by their tolerances; candidates are ranked by the error on the validation
records. A case is fair when the true effect comes first, or when one that comes first is told apart by less than 2 % of
the error. Prints rank of the truth, its share, and the best other candidate.
"""

import argparse
import dataclasses
import json
import pathlib
import re

import numpy as np
from scipy.optimize import least_squares

from score_third_party import sampled
from systems import SYSTEMS
from truth import Machine, parameters, scales

FRICTION = "viscous coulomb stribeck spring endstop cogging quaddrag offset asymmetry poscoulomb".split()
COMMAND = "gain command_offset deadband saturation hysteresis delay lag droop".split()
SENSOR = "sensor_gain sensor_offset sensor_delay".split()
SHAPES = {
    "cogging": [(a, b, 1) for a in (0, 0.33, 0.67, 1) for b in (0.25, 0.75)],
    "endstop": [(0, 0, 1), (0.6, 0, 1)],
    "stribeck": [(0, 0, 1), (0.8, 0, 1)],
}


class Case:
    def __init__(self, folder):
        self.truth = json.loads((folder / "truth.json").read_text())
        # Coarser than the records were made with: far below the noise still.
        self.system = system = dataclasses.replace(SYSTEMS[self.truth["system"]], inner=2)
        text = (folder / "study.toml").read_text()
        self.records = []
        for file, role, start in re.findall(r'file = "(.*)"\nrole = "(.*)"\ninitial = \{(.*)\}', text):
            table = np.loadtxt(folder / file, delimiter=",", skiprows=1)
            u = table[:, 1 : 1 + len(system.commands)]
            self.records.append(
                dict(
                    u=u,
                    sent=u,
                    reference=np.zeros(len(u)),
                    wobble=np.zeros(len(u)),
                    start=np.array([float(p.split("=")[1]) for p in start.split(",")]),
                    y=table[:, 1 + len(system.commands) :],
                    role=role,
                )
            )
        self.noise = np.array(list(self.truth["noise"].values()))
        for r in self.records:
            r["x"] = Machine(system, system.declared(), []).run(r)
        self.estimation, self.validation = ([r for r in self.records if r["role"] == role] for role in ("estimation", "validation"))
        self.scale = {port: scales(system, port, self.records) for port in system.ports}
        ones = dict(F=1.0, V=1.0, X=1.0, U=1.0, step=system.step, pace=system.pace)
        self.scale |= {
            name: dict(ones, Y=np.ptp(np.concatenate([r["y"][:, k] for r in self.records]))) for k, name in enumerate(system.measured)
        }
        self.messy = self.truth["kind"] == "messy"
        self.tolerance = {name: own[2] for name, own in system.parameters.items() if own[2]} if self.messy else {}

    def residual(self, records, effects, values=None):
        machine, found = Machine(self.system, values or self.system.declared(), effects), []
        for r in records:
            try:
                y = machine.sense(machine.run(r))
            except ArithmeticError:
                return np.full(sum(r["y"][::2].size for r in records), 1e4)
            found.append((((np.array(list(y.values())).T - r["y"]) / self.noise)[::2]).ravel().clip(-1e4, 1e4))
        return np.concatenate(found)

    def slopes(self, records):
        """Change of the residual with one tolerance of each declared parameter, `[samples, parameters]`."""
        base, declared = self.residual(records, []), self.system.declared()
        return np.array(
            [
                (self.residual(records, [], declared | {name: declared[name] * (1 + 0.3 * tolerance)}) - base) / 0.3
                for name, tolerance in self.tolerance.items()
            ]
        ).T

    def corrected(self, residual, slopes):
        """Residual with the best declared parameters, and these in tolerances. The residual of a messy machine is not
        white: its level weighs the tolerances."""
        if not self.tolerance:
            return residual, np.zeros(0)
        level = max(1.0, np.mean(residual**2)) * 30.0
        d = np.linalg.solve(slopes.T @ slopes + level * np.eye(slopes.shape[1]), -slopes.T @ residual)
        return residual + slopes @ d, d

    def fit(self, kind, port, slopes, held):
        """Error on the validation records of the best fit on the estimation records."""
        best = None
        starts = [(s, z) for z in SHAPES.get(kind, [(0.5, 0.5, 1)]) for s in (0.5,)]
        if kind in ("delay", "sensor_delay"):
            starts = [(n / self.system.pace, (0.5, 0.5, 1)) for n in range(1, 41)]
        for strength, z in starts:
            own = parameters(kind, strength, z, self.scale[port])
            keys, x0 = list(own), np.array(list(own.values()))
            unit = np.where(x0 == 0, abs(x0[0]), np.abs(x0))

            def effects(q):
                return [(kind, port, dict(zip(keys, q * unit)), self.scale[port])]

            if kind in ("delay", "sensor_delay"):
                q, error = np.ones(1), self.corrected(self.residual(self.estimation, effects(np.ones(1))), slopes)[0]
                cost = float(np.sum(error**2))
            else:
                fun = lambda q: self.corrected(self.residual(self.estimation, effects(q)), slopes)[0] * 1.0
                found = least_squares(fun, x0 / unit, method="trf", max_nfev=7, diff_step=1e-3, bounds=(-200, 200))
                q, cost = found.x, 2 * found.cost
            if best is None or cost < best[0]:
                best = cost, effects(q)
        d = self.corrected(self.residual(self.estimation, best[1]), slopes)[1]
        error = self.residual(self.validation, best[1]) + (held @ d if len(d) else 0.0)
        return float(np.sqrt(np.mean(error**2))), best[1]


def candidates(system):
    for port, own in system.ports.items():
        if own.velocity:
            yield from ((kind, port) for kind in FRICTION)
        elif own.position:
            yield from ((kind, port) for kind in ("leakage", "offset"))
        if port in system.commands:
            yield from ((kind, port) for kind in COMMAND)
    yield from ((kind, name) for name in system.measured for kind in SENSOR)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--sample", type=int, default=0)
    args = parser.parse_args()
    folders = sampled(sorted(p.parent for p in args.cases.glob("*/truth.json") if re.search(args.only, p.parent.name)), args.sample)
    fair = count = 0
    for folder in folders:
        case = Case(folder)
        if case.truth["class"] != "single":
            continue
        slopes, held = (case.slopes(r) if case.tolerance else None for r in (case.estimation, case.validation))
        residual, d = case.corrected(case.residual(case.estimation, []), slopes)
        alone = case.residual(case.validation, [])
        calibrated = alone + held @ d if case.tolerance else alone
        rms = lambda e: float(np.sqrt(np.mean(e**2)))
        rows = sorted((case.fit(kind, port, slopes, held)[0], kind, port) for kind, port in candidates(case.system))
        true = case.truth["effects"][0]
        kinds = {true["kind"], f"sensor_{true['kind']}" if true["signal"] else "", f"command_{true['kind']}", *true["alike"]}
        place = [k for k, (_, kind, port) in enumerate(rows) if kind in kinds and port == true["port"]]
        own = rows[place[0]][0] if place else rms(calibrated)
        other = next(row for k, row in enumerate(rows) if k not in place)
        # A change of a declared parameter, in a messy case, is in the calibration already.
        right = bool(place) and (place[0] == 0 or own < other[0] * 1.02)
        count, fair = count + bool(place), fair + right
        print(
            f"{folder.name:<38} declared {rms(alone):8.2f} calibrated {rms(calibrated):7.2f} true {own:7.2f} rank {place[0] + 1 if place else '-'}; best other {other[1]}@{other[2]} {other[0]:.2f}"
            + ("" if right or not place else "  NOT FIRST"),
            flush=True,
        )
    print(f"the true effect comes first in {fair} of {count}")


if __name__ == "__main__":
    main()
