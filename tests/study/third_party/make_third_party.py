"""Makes the cases of the third-party systems: records of six machines with known truth, the FMU of each declared model, and
two studies per case.

    python make_third_party.py DIR [--seed S] [--only REGEX]

A case DIR/SYSTEM_E_NAME: E is `e`, exact: the declared values are right, an effect and white sensor noise; or `m`,
messy: every declared value is off by its tolerance, small forces of no listed form act at every port, and the noise is
colored. Names: `KIND_PORT` an effect, `pair_...`, `none` a control, `outside_...` an effect that no vocabulary has,
`beside_...` one of each.
`study.toml` attaches channels to inputs, `plain.toml` leaves the places to the program. truth.json holds the answer;
see score_third_party.py.

An exact effect is scaled so that the error of the declared model on validation records is 6 to 30 times the sensor
noise; a messy one takes 62 to 96 % of the validation error when it is put into the declared model with its true
parameters, and leaves an error of 1.5 times the noise or more. Draws that cannot be scaled so are drawn again.
"""

import argparse
import json
import pathlib
import re
import zlib

import numpy as np

import fmu
from catalog import ALIKE, BESIDE, CONTROLS, IDS, OUTSIDE, PAIRS, SAME, SINGLES, SMALL, SMALL_COMMAND
from systems import SYSTEMS, multisine
from truth import MAIN, PARAMETERS, Machine, parameters, scales

FLOORS, SHARES = (6.0, 30.0), (0.66, 0.94)
LEFT = 1.5
# Times what is typical of a listed effect: a gain error of 30 %, friction of half the drive.
STRONGEST = 6.0
TRIES = 12


def excitation(system, rng, k):
    """Commands `[n, inputs]` of record k, before any feedback."""
    t = np.arange(round(system.duration / system.step) + 1) * system.step
    size = rng.uniform(0.65, 1.0)
    sent = np.array([size * system.inputs[name][1] * system.excite(rng, k + j, t) for j, name in enumerate(system.commands)]).T
    reference = np.zeros(len(t))
    if system.name == "tanks":
        sent += 6.0
    if system.gain:
        sent, reference = 1.5 * multisine(rng, t, 1.0, 8.0)[:, None], 0.045 * size * system.excite(rng, k, t)
    start = np.array([system.start.get(name, 0.0) for name in system.states])
    return dict(sent=np.round(sent, 4), reference=reference, wobble=5e-5 * rng.standard_normal(len(t)), start=start, u=np.round(sent, 4))


def settled(system, values, record):
    """The tanks start at the levels that the first command keeps."""
    if system.name == "tanks":
        flow = values["k_p"] * record["u"][0, 0]
        record["start"] = np.round([(flow / values[s]) ** 2 / (2 * values["g"]) for s in ("s_1", "s_2")], 5)


def rms(a):
    return float(np.sqrt(np.mean(np.square(a))))


def runs(machine, records):
    return [machine.sense(machine.run(r)) for r in records]


def errors(system, truth, model):
    """Rms over records of the difference, per signal."""
    return np.array([rms(np.concatenate([a[name] - b[name] for a, b in zip(truth, model)])) for name in system.measured])


class Draw:
    """A case before it is written: records, true parameters, effects with shapes, small terms."""

    def __init__(self, system, names, messy, rng, third_party=False):
        self.system, self.names, self.messy, self.rng, self.third_party = system, names, messy, rng, third_party
        self.count = int(rng.integers(4, 6))
        self.roles = ["estimation"] * (self.count - 1 - (self.count > 4)) + ["validation"] * (1 + (self.count > 4))
        self.records = [excitation(system, rng, k) for k in range(self.count)]
        self.values = {
            name: value * (1 + tolerance * rng.standard_normal() * messy) for name, (value, _, tolerance) in system.parameters.items()
        }
        self.noise = np.array(
            [np.hypot(noise, quantum / np.sqrt(12)) * (np.sqrt(2) if messy else 1) for noise, quantum in system.measured.values()]
        )
        self.shapes = {name: rng.uniform(0, 1, 3) for name in names}
        for r in self.records:
            settled(system, self.values, r)
            r["x"] = Machine(system, self.values, []).run(r, closed=True)
        ranges = {
            name: np.ptp(np.concatenate([r["x"][:, list(system.states).index(name)] for r in self.records])) for name in system.measured
        }
        self.scale = {port: scales(system, port, self.records) for port in system.ports}
        self.scale |= {
            name: dict(Y=width, F=1.0, V=1.0, X=1.0, U=1.0, step=system.step, pace=system.pace) for name, width in ranges.items()
        }
        self.scale |= {name: dict(F=1.0, V=1.0, X=1.0, U=1.0, step=system.step, pace=system.pace) for name in system.parameters}
        self.validation = [r for r, role in zip(self.records, self.roles) if role == "validation"]
        self.small = self.small_terms() if messy else []

    def effect(self, name, strength):
        kind, port = name.split("@")
        return kind, port, parameters(kind, strength, self.shapes[name], self.scale[port]), self.scale[port]

    def small_terms(self):
        """A term at every port, scaled to 0.2 to 0.6 of the error that the wrong parameters make."""
        system, rng, found = self.system, self.rng, []
        truth = runs(Machine(system, self.values, []), self.validation)
        off = self.size(errors(system, truth, runs(Machine(system, system.declared(), []), self.validation)))
        for port, own in system.ports.items():
            forms = ([rng.choice(SMALL)] if own.velocity else [rng.choice(["bump", "wander"])] if port not in system.commands else []) + (
                [rng.choice(SMALL_COMMAND)] if port in system.commands else []
            )
            for form in forms:
                z, target, strength = rng.uniform(0, 1, 3), off * rng.uniform(0.2, 0.6), 0.3
                for _ in range(4):
                    one = form, port, parameters(form, strength, z, self.scale[port]), self.scale[port]
                    reached = self.size(errors(system, truth, runs(Machine(system, self.values, [one]), self.validation)))
                    strength = min(strength * np.clip(target / max(reached, 1e-12), 0.1, 10.0), 2.0)
                one = form, port, parameters(form, strength, z, self.scale[port]), self.scale[port]
                found.append(one)
        return found

    def size(self, error):
        """An error in multiples of the noise floor."""
        return float(np.max(error / self.noise))

    def with_strengths(self, strengths):
        """Figures of the declared model without and with the true effects: errors, share of all and of each."""
        system = self.system
        effects = [self.effect(name, s) for name, s in zip(self.names, strengths)]
        true = Machine(system, self.values, effects + self.small)
        for r in self.records:
            if system.gain:
                true.run(r, closed=True)
            settled(system, true.values, r)
        truth = runs(true, self.validation)
        before = errors(system, truth, runs(Machine(system, system.declared(), []), self.validation))
        unit = np.hypot(before, self.noise)
        share = lambda own: 1 - rms(errors(system, truth, runs(Machine(system, system.declared(), own), self.validation)) / unit) / rms(
            before / unit
        )
        self.effects = effects
        return dict(
            before=before,
            floors=self.size(before),
            share=share(effects) if effects else 0.0,
            each=[share([one]) for one in effects],
            after=errors(system, truth, runs(Machine(system, system.declared(), effects), self.validation)),
        )

    def scaled(self):
        """Figures at strengths that fit the class of the case; None where there are none."""
        if not self.names:
            figures = self.with_strengths([])
            return None if self.messy and figures["floors"] < LEFT else figures
        rng = self.rng
        ratio = np.exp(rng.uniform(-0.3, 0.3, len(self.names)))
        target = rng.uniform(*(SHARES if self.messy else np.log(FLOORS)))
        limits, best = ((SHARES[0] - 0.04, SHARES[1] + 0.02) if self.messy else np.log(FLOORS)), None
        if len(self.names) > 1:
            # Each of a pair alone reaches about the same error.
            ratio = ratio / np.array([max(self.alone(k), 1e-9) for k in range(len(self.names))])
            ratio /= ratio.max()
        # First over the whole range, then between the best one and its neighbors.
        for part in (None, 1.0, 0.25, 0.0625, 0.015625):
            tried = (
                [best[1] * 1.7 ** (sign * part) for sign in (-1, 1)] if part and best else np.geomspace(0.01, 12.0, 10) if not part else []
            )
            for strength in tried:
                if strength > STRONGEST and not self.third_party:
                    continue
                try:
                    own = self.with_strengths(strength * ratio)
                except ArithmeticError:
                    continue
                value = own["share"] if self.messy else np.log(own["floors"])
                if best is None or abs(value - target) < abs(best[0] - target):
                    best = value, strength
        if best is None or not limits[0] <= best[0] <= limits[1]:
            return None
        figures = self.with_strengths(best[1] * ratio)
        try:
            runs(Machine(self.system, self.values, self.effects + self.small), self.records)
        except ArithmeticError:
            return None
        # On a messy machine something is left.
        return None if self.messy and self.size(figures["after"]) < LEFT else figures

    def alone(self, k):
        return self.with_strengths([0.5 if j == k else 1e-6 for j in range(len(self.names))])["floors"]


def signals(draw, rng):
    """Measured columns of every record."""
    system, found = draw.system, []
    machine = Machine(system, draw.values, draw.effects + draw.small)
    for r in draw.records:
        y = machine.sense(machine.run(r))
        for name, (noise, quantum) in system.measured.items():
            e = noise * rng.standard_normal(len(y[name]))
            if draw.messy:
                slow, keep = np.zeros(len(e)), np.exp(-1 / 8.0)
                for k in range(1, len(e)):
                    slow[k] = keep * slow[k - 1] + np.sqrt(1 - keep**2) * noise * rng.standard_normal()
                e = e + slow
            y[name] = np.round((y[name] + e) / quantum) * quantum
        found.append(y)
    return found


def write(folder, draw, figures, cls):
    system = draw.system
    folder.mkdir(parents=True, exist_ok=True)
    time = np.arange(len(draw.records[0]["u"])) * system.step
    for k, (r, y) in enumerate(zip(draw.records, signals(draw, draw.rng))):
        columns = [time, *r["u"].T, *y.values()]
        np.savetxt(
            folder / f"record_{k}.csv",
            np.array(columns).T,
            fmt="%.9g",
            delimiter=",",
            header=",".join(["time", *system.commands, *y]),
            comments="",
        )
    (folder / "study.toml").write_text(study(draw, folder.name, True))
    (folder / "plain.toml").write_text(study(draw, folder.name, False))
    (folder / "truth.json").write_text(json.dumps(truth(draw, figures, cls), indent=1) + "\n")


def study(draw, name, attached):
    system = draw.system
    text = f'name = "{name}"\nsystem = "../fmu/{system.name}.fmu"\n\n[inputs]\n'
    text += "".join(f'{u} = {{ column = "{u}", unit = "{system.inputs[u][0]}", hold = true }}\n' for u in system.commands)
    text += "\n[outputs]\n" + "".join(f'{y} = {{ column = "{y}", unit = "{system.states[y][0]}" }}\n' for y in system.measured)
    if not attached and draw.messy and draw.stated:
        text += "\n[tolerance]\n" + "".join(f"{name} = {tolerance}\n" for name, (_, _, tolerance) in system.parameters.items() if tolerance)
    for k, (role, r) in enumerate(zip(draw.roles, draw.records)):
        start = ", ".join(f"{x} = {value!r}" for x, value in zip(system.states, map(float, r["start"])))
        text += f'\n[[segment]]\nfile = "record_{k}.csv"\nrole = "{role}"\ninitial = {{ {start} }}\n'
    for port, own in system.ports.items() if attached else []:
        if not own.channels:
            continue
        keys = [("velocity", own.velocity), ("position", own.position), ("viscous", own.viscous), ("coulomb", own.coulomb)]
        text += f'\n[[attachment]]\ninput = "{port}"\nchannels = {json.dumps(own.channels)}\n'
        text += "".join(f'{key} = "{value}"\n' for key, value in keys if value) + (f"vt = {own.vt}\n" if own.vt else "")
    return text


def units(system, port, kind):
    own = system.ports.get(port)
    force = system.inputs[port][0] if port in system.inputs else "1"
    unit = dict(
        F=force,
        V=system.states[own.velocity][0] if own and own.velocity else "1",
        X=system.states[own.position][0] if own and own.position else "1",
        U=force,
        Y=system.states[port][0] if port in system.states else "1",
    )
    one = lambda text: re.sub(r"[FVXUY]", lambda m: f"({unit[m[0]]})", text) if text not in unit else unit[text]
    return {name: one(text) for name, text in PARAMETERS.get(kind, {}).items()}


def truth(draw, figures, cls):
    """The right answer in both flavours of the study."""
    system, effects = draw.system, []
    for (kind, port, values, _), share in zip(draw.effects, figures["each"]):
        own, unit = system.ports.get(port), units(system, port, kind)
        channel = next((c for c in own.channels if kind in IDS[c]), None) if own else "sensor" if port in system.measured else None
        identity = IDS[channel][kind] if own and channel else kind.replace("_", ".") if channel else None
        effects.append(
            {
                "kind": kind.removeprefix("sensor_").removeprefix("command_"),
                "port": port,
                "id": identity,
                "channel": channel,
                "signal": port if channel == "sensor" else None,
                "params": {k: {"value": float(v), "unit": unit.get(k, "1")} for k, v in values.items()},
                "main": MAIN.get(kind, next(iter(values))),
                "share": round(share, 4),
                "parameter": port if kind == "parameter" else SAME.get((system.name, f"{kind}@{port}")),
                "alike": ALIKE.get(kind, []),
                "listed": kind in PARAMETERS,
            }
        )
    verdict = {"outside": "unexplained", "control": "none"}.get(cls, "effect")
    inside = verdict == "effect" and all(e["id"] for e in effects if e["listed"])
    figure = lambda values: dict(zip(system.measured, (float(f"{v:.4g}") for v in values)))
    return {
        "system": system.name,
        "kind": "messy" if draw.messy else "exact",
        "class": cls,
        "verdict": {"study": verdict if inside or verdict != "effect" else "unexplained", "plain": verdict},
        "effects": effects,
        "share": round(figures["share"], 4),
        "noise": figure(draw.noise),
        "floors_before": figure(figures["before"] / draw.noise),
        "floors_after": figure(figures["after"] / draw.noise),
        "off": {k: round(v / system.parameters[k][0] - 1, 5) for k, v in draw.values.items()} if draw.messy else {},
        "small": [{"kind": kind, "port": port, "params": {k: float(v) for k, v in values.items()}} for kind, port, values, _ in draw.small],
    }


def cases():
    """Name, system, effects, messy, class."""
    for name, system in SYSTEMS.items():
        for messy in (False, True):
            short = f"{name}_{'em'[messy]}"
            for one in SINGLES[name].split():
                yield f"{short}_{one.replace('@', '_')}", system, [one], messy, "single"
            for k, pair in enumerate(PAIRS[name].split()):
                yield f"{short}_pair_{re.sub('[@+]', '_', pair)}", system, pair.split("+"), messy, "pair"
            for k in range(CONTROLS):
                yield f"{short}_none_{k + 1}", system, [], messy, "control"
            for pair in BESIDE[name].split() if not messy else []:
                yield f"{short}_beside_{re.sub('[@+]', '_', pair)}", system, pair.split("+"), messy, "beside"
            for one in OUTSIDE[name].split():
                yield f"{short}_outside_{one.replace('@', '_')}", system, [one], messy, "outside"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="regular expression on the names")
    args = parser.parse_args()
    for name, system in SYSTEMS.items():
        fmu.make(system, args.folder / "fmu" / f"{name}.fmu")
    for name, system, effects, messy, cls in cases():
        if not re.search(args.only, name):
            continue
        rng = np.random.default_rng([args.seed, zlib.crc32(name.encode())])
        figures = None
        for _ in range(TRIES):
            try:
                draw = Draw(system, effects, messy, rng, cls in ("outside", "beside"))
                figures = draw.scaled()
            except ArithmeticError:
                continue
            draw.stated = bool(rng.random() < 0.5)
            if figures:
                break
        if not figures:
            print(f"{name}: given up", flush=True)
            continue
        write(args.folder / name, draw, figures, cls)
        print(f"{name:<42} floors {figures['floors']:7.1f} share {figures['share']:.3f}", flush=True)


if __name__ == "__main__":
    main()
