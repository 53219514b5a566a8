"""Cramer-Rao bound of the parameters of missing effects: what no unbiased estimate from the estimation records can beat.

Fisher information of the records by central differences of rig.py at the true parameters, with the declared noise of the
sensors taken as white; the initial position and angle of every trial are unknown, too. Neither cases with declared
parameters that are off (they have priors) nor those on the first-principles actuator have a bound here.
"""
import tomllib

import numpy as np

from make_cases import sensed
from rig import DECLARED, TS, simulate, sweep

STEP = 1e-3
START = {"x0": 1e-5, "th0": 1e-4}


def has_bound(truth):
    return truth.get("effects") and truth["class"] in ("single", "double", "few sensors")


class Case:
    """One case with the lanes of its differences: every parameter moved up and down, then the initial states."""

    def __init__(self, folder):
        self.declaration = tomllib.loads((folder / "case.toml").read_text())
        truth = tomllib.loads((folder / "truth.toml").read_text())
        self.effects = [(e["id"], e["params"], e.get("signal")) for e in truth["effects"]]
        self.kind, self.sensors = self.declaration["kind"], self.declaration["sensors"]
        files = [f["name"] for f in self.declaration["files"] if f["role"] == "estimation"]
        self.records = [np.genfromtxt(folder / name, delimiter=",", names=True) for name in files]
        self.names = [(i, name) for i, (_, params, _) in enumerate(self.effects) for name in params]
        self.steps = [STEP * max(abs(self.effects[i][1][name]), 1e-6) for i, name in self.names]
        self.starts = list(START) if self.kind == "cartpole" else []

    def moved(self):
        """(effects, shift of x0, shift of th0) of every difference, up and down in turn."""
        for (i, name), step in zip(self.names, self.steps):
            for sign in (1, -1):
                effects = [(e, dict(p), s) for e, p, s in self.effects]
                effects[i][1][name] += sign * step
                yield effects, 0.0, 0.0
        for name in self.starts:
            for sign in (1, -1):
                yield self.effects, sign * START[name] * (name == "x0"), sign * START[name] * (name == "th0")

    def deviations(self, shown):
        """Standard deviations of the parameters; `shown`: signals [samples, trials] of every difference."""
        steps = self.steps + [START[name] for name in self.starts]
        weight = {s: 1.0 / sensor["noise_rms"] for s, sensor in self.sensors.items() if sensor["noise_rms"] > 0}
        columns = [[np.concatenate([(up[s][:, j] - down[s][:, j]) * weight[s] for s in weight]) / (2 * step)
                    for j in range(len(self.records))] for up, down, step in zip(shown[::2], shown[1::2], steps)]
        n, m = len(self.names), len(self.starts)
        information = np.zeros((n, n))
        for j in range(len(self.records)):
            jacobian = np.array([column[j] for column in columns]).T
            own = jacobian.T @ jacobian
            # The initial states of this trial, eliminated.
            information += own[:n, :n] - (own[:n, n:] @ np.linalg.solve(own[n:, n:], own[n:, :n]) if m else 0.0)
        scale = np.sqrt(np.diag(information))
        covariance = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
        return {(self.effects[i][0], name): float(sd) for (i, name), sd in zip(self.names, np.sqrt(np.diag(covariance)))}


def plain(effects):
    return {e: p for e, p, s in effects if s is None}


def of_sweeps(folder, case):
    """Sweeps, their motion taken as known."""
    if not (folder / "truth.npz").exists() or any(s in ("x", "v") for _, _, s in case.effects):
        return None
    data = np.load(folder / "truth.npz")
    case.sensors = {"F_p": case.sensors["F_p"]}
    carts = [f["experiment"] == "sweep_cart" for f in case.declaration["files"]]
    chosen = [i for i, f in enumerate(case.declaration["files"]) if f["role"] == "estimation"]
    shown = []
    for effects, _, _ in case.moved():
        runs = [sweep(plain(effects), DECLARED, carts[i], data["motion"][i])["F_p"] for i in chosen]
        shown.append(sensed({"F_p": np.array(runs).T}, effects))
    return case.deviations(shown)


def of_runs(cases):
    """Coupled or rod-fixed cases of one length, all differences side by side."""
    lanes, u, x0, th0 = [], [], [], []
    for case in cases:
        for effects, dx, dth in case.moved():
            for record in case.records:
                lanes.append(plain(effects))
                u.append(record["u"])
                x0.append(dx + (record["x"][0] if case.starts else 0.0))
                th0.append(dth + (record["theta"][0] if case.starts else 0.0))
    plant = {k: np.full(len(lanes), v) for k, v in DECLARED.items()}
    u = np.array(u)
    out = simulate(lanes, u, np.array(x0), np.array(th0), plant, np.zeros_like(u.T), centring=0.0,
                   fixed=cases[0].kind == "actuator")
    found, lane = [], 0
    for case in cases:
        shown = []
        for effects, _, _ in case.moved():
            own = slice(lane, lane + len(case.records))
            shown.append(sensed({s: out[s][:, own] for s in case.sensors if s != "u"}, effects))
            lane = own.stop
        found.append(case.deviations(shown))
    return found


def bounds(folders, together=8):
    """Standard deviation of every parameter (effect, name) by the name of the case."""
    found, runs = {}, {"cartpole": [], "actuator": []}
    for folder in folders:
        if not has_bound(tomllib.loads((folder / "truth.toml").read_text())):
            continue
        case = Case(folder)
        if case.kind == "friction":
            found[folder.name] = of_sweeps(folder, case)
        else:
            runs[case.kind].append((folder.name, case))
    for own in runs.values():
        for start in range(0, len(own), together):
            some = own[start:start + together]
            found.update(zip([name for name, _ in some], of_runs([case for _, case in some])))
    return {name: own for name, own in found.items() if own}
