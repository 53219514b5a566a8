"""Makes cases for the study of `airloop refine`: records of the rig with undeclared effects, alone, in pairs, outside
the vocabulary, with few sensors, with declared parameters off, on the first-principles actuator and on such actuators of
other dimensions, and controls.

Independent of the library: the rig is that of rig.py. The strength of an effect is drawn, not its parameters: the
largest rms error of windowed predictions of the declared model (0.5 s from the true state, the actuator running on), in
units of 0.3 N, 2 mm and 10 mrad; for half of the sensor effects in units of the noise of that sensor.

    python make_cases.py DIR [--seed S] [--only WORD,WORD]
"""
import argparse
import pathlib
import re

import numpy as np

from effects import EFFECTS, OUTSIDE, channel, draw, scaled
from rig import A1, B0, B1, CYLINDER, DECLARED, N, TS, identified, simulate, sweep

ARX_FP = ([[-1.013602, 0.027052], [-0.032284, -0.95853]], [0.225645, -0.162456], [-0.213883, 0.168954])
UNITS = {"F_hat": 0.3, "F_p": 0.3, "x": 2e-3, "theta": 1e-2}
STRENGTH = (1.0, 5.0)
# Motion over the stroke that no trial on another cylinder exceeds: commands that lead there are made smaller.
MOST_TRAVEL = 0.45


def commands(rng, n=N):
    """Five feed-forward commands: sums of sines up to 4 Hz, 30 to 55 N at most, from rest."""
    t = np.arange(n) * TS
    found = []
    for _ in range(5):
        f, phase, amp = rng.uniform(0.3, 4.0, 6), rng.uniform(0, 2 * np.pi, 6), rng.uniform(0.3, 1.0, 6)
        u = (amp[:, None] * np.sin(2 * np.pi * f[:, None] * t + phase[:, None])).sum(0) * (1 - np.exp(-t / 0.1))
        found.append(u * rng.uniform(30.0, 55.0) / np.abs(u).max())
    return np.array(found)


def chirps_and_stairs(rng, n=8000):
    """Commands for a fixed rod: three chirps of 0.1 to 12 Hz and two random stairs."""
    t = np.arange(n) * TS
    phase = 2 * np.pi * (0.1 * t + (12 - 0.1) * t**2 / (2 * t[-1]))
    found = [a * np.sin(phase) for a in (12.0, 24.0, 42.0)]
    for _ in range(2):
        levels = np.repeat(rng.uniform(-40, 40, 40), 200)[:n]
        found.append(levels)
    return np.array(found)


FIXED_FILES = [("chirp_small", True), ("chirp_mid", False), ("chirp_large", True), ("stairs_1", True), ("stairs_2", False)]
SWEEP_FILES = [("piston_1", True), ("piston_2", True), ("piston_3", False), ("cart_1", True), ("cart_2", True), ("cart_3", False)]


def sensed(data, effects, dt=TS):
    """Sensor effects on noise-free signals."""
    data = dict(data)
    for effect, params, signal in effects:
        if signal is None:
            continue
        y = data[signal]
        if effect == "sensor.offset":
            y = y + params["value"]
        elif effect == "sensor.gain":
            y = y * (1 + params["gain"])
        else:
            t = np.arange(len(y)) * dt
            y = np.array([np.interp(t - params["delay"], t, column) for column in y.T]).T
        data[signal] = y
    return data


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def cylinders(cases, count):
    """Dimensions of the cylinders of all cases [cases * count]; none where the actuator is the declared one."""
    if not cases[0].get("fp"):
        return None
    own = lambda c, name: c.get("dimensions", CYLINDER)[name]
    return {name: np.repeat([own(c, name) for c in cases], count) for name in CYLINDER}


def run(cases, effects_of, trials, samples=None):
    """Simulates some trials of all cases: states and signals [samples, cases * trials]."""
    lanes = [{e: p for e, p, s in effects_of(c) if s is None} for c in cases for _ in trials]
    pick = lambda key, axis: np.concatenate([np.take(c[key], trials, axis=axis) for c in cases], axis=axis)
    plant = {k: np.repeat([c["plant"][k] for c in cases], len(trials)) for k in DECLARED}
    return simulate(lanes, pick("ff", 0)[:, :samples], pick("x0", 0), pick("th0", 0), plant, pick("noise_x", 1),
                    cylinder=cylinders(cases, len(trials)), fixed=cases[0]["kind"] == "actuator"), plant


def strengths(cases, effects_of, coupled=(0,)):
    """Error of windowed predictions of the model without effects against `effects_of`, on one trial (coupled: on those given), by case."""
    trials = [2] if cases[0]["kind"] == "actuator" else list(coupled)
    count = len(trials)
    truth, plant = run(cases, effects_of, trials, 8000 if cases[0]["kind"] == "actuator" else 1500)
    zero = np.zeros(len(cases) * count)
    u = truth["u"].T
    declared = simulate([{} for _ in zero], u, zero, zero, plant, np.zeros_like(truth["u"]), centring=0.0,
                        cylinder=cylinders(cases, count), restart=truth["states"], fixed=cases[0]["kind"] == "actuator")
    found = []
    for i, c in enumerate(cases):
        lanes = slice(count * i, count * (i + 1))
        own = sensed({k: truth[k][:, lanes] for k in UNITS}, effects_of(c))
        found.append(max(rms(own[k] - declared[k][:, lanes]) / c["units"][k] for k in UNITS))
    return np.array(found)


def calibrate(cases):
    """Scales every effect of every case to its strength, one effect at a time."""
    for j in range(2):
        chosen = [c for c in cases if len(c["effects"]) > j]
        if not chosen:
            return
        factor = np.ones(len(chosen))
        target = np.array([c["strengths"][j] for c in chosen])
        base = [c["effects"][j] for c in chosen]
        for _ in range(3):
            for c, b, k in zip(chosen, base, factor):
                c["trial_effect"] = [(b[0], scaled(b[0], b[1], k), b[2])]
            reached = strengths(chosen, lambda c: c["trial_effect"])
            factor = np.clip(factor * np.clip(target / np.maximum(reached, 1e-3), 0.3, 3.0), 0.02, 20.0)
        for c, b, k in zip(chosen, base, factor):
            c["effects"][j] = (b[0], scaled(b[0], b[1], k), b[2])


MODEL = ["", "# c1*tanh(c2*(xdot - c3)) + c4*xdot + c5", "[model.piston_friction]", "c1 = 1.5145", "c2 = 40.8926", "c3 = 0.0", "c4 = 49.2734", "c5 = 0.0",
         "[model.cart_friction]", "c1 = 5.7910", "c2 = 63.7045", "c3 = 0.0064", "c4 = 0.0", "c5 = -2.3170",
         "", "[model.cart_pole]", "m_c = 0.399", "m_p = 0.1", "l = 0.2", "g = 9.81", "b_p = 0.0006",
         "tip_distance = 0.25   # pivot to free end of the rod", "stroke = 0.300"]
SENSORS = {"u": ("N", "force command as sent (exact)"), "F_hat": ("N", "pressure sensors, S1*p1 - S2*p2"),
           "F_p": ("N", "load cell between piston rod and cart"), "x": ("m", "linear potentiometer"),
           "v": ("m/s", "drive encoder of the imposed motion"), "theta": ("rad", "encoder, 4096 counts per turn")}


def write(folder, c, files, data):
    """One case: `files` are (name, estimation, experiment, group), `data` signals [N, files]."""
    target = folder / c["name"]
    target.mkdir(parents=True, exist_ok=True)
    text = [f'id = "{c["name"]}"', f'kind = "{c["kind"]}"', "sample_rate_hz = 1000"]
    if c["kind"] != "friction":
        a, b0, b1 = c.get("arx", ARX_FP if c.get("fp") else (A1, B0, B1))
        text += ["", "# y = [F_hat, F_p]: y(k) + A1 y(k-1) = B0 u(k) + B1 u(k-1); F_p here is the rod-fixed force, before piston friction",
                 "[model.actuator]", "sample_time = 0.001", f"A1 = {np.asarray(a).tolist()}",
                 f"B0 = {np.asarray(b0).tolist()}", f"B1 = {np.asarray(b1).tolist()}"]
    text += MODEL if c["kind"] != "actuator" else []
    text += [""]
    for signal in c["signals"]:
        unit, what = SENSORS[signal]
        text += [f"[sensors.{signal}]", f'unit = "{unit}"', f'what = "{what}"', f"noise_rms = {c['noise'][signal]}"]
    text += [""]
    # The files of a fixed rod are listed with those for validation last.
    order = sorted(range(len(files)), key=lambda i: c["kind"] == "actuator" and not files[i][1])
    for i in order:
        name, estimation, experiment, group = files[i]
        text += ["[[files]]", f'name = "{name}.csv"', f'role = "{"estimation" if estimation else "validation"}"',
                 f'experiment = "{experiment}"', f'group = "{group}"']
        n = len(data[c["signals"][0]])
        columns = [np.arange(n) * TS] + [data[s][:, i] for s in c["signals"]]
        formats = ["%.3f"] + [{"u": "%.3f", "x": "%.5f", "theta": "%.5f", "v": "%.4f"}.get(s, "%.2f") for s in c["signals"]]
        np.savetxt(target / f"{name}.csv", np.array(columns).T, fmt=formats, delimiter=",",
                   header=",".join(["time", *c["signals"]]), comments="")
    (target / "case.toml").write_text("\n".join(text) + "\n")
    verdict = {"control": "none", "outside": "unexplained", "messy_control": "unexplained", "other cylinder, control": "unexplained"}.get(c["cls"], "effect")
    lines = [f'class = "{c["cls"]}"', f'verdict = "{verdict}"', f"strengths = {[round(float(s), 2) for s in c['strengths']]}"]
    lines += [f"{k} = {v}" for k, v in c.get("figures", {}).items()]
    for effect, params, signal in c["effects"] if verdict == "effect" else []:
        lines += ["[[effects]]", f'id = "{effect}"', f'channel = "{channel(effect)}"']
        lines += [f'signal = "{signal}"'] if signal else []
        lines += ["[effects.params]"] + [f"{k} = {float(v)!r}" for k, v in params.items()]
    if c.get("channel"):
        lines += ["[unexplained]", f'channel = "{c["channel"]}"']
    (target / "truth.toml").write_text("\n".join(lines) + "\n")


def specification(rng):
    """Names and effects of the cases."""
    cases = []

    def add(name, cls, effects, kind="cartpole", **more):
        cases.append(dict(name=name, cls=cls, kind=kind, strengths=list(rng.uniform(*STRENGTH, max(1, len(effects)))),
                          effects=[(e, draw(rng, {**EFFECTS, **{k: v[1] for k, v in OUTSIDE.items()}}[e]), s) for e, s in effects], **more))

    own = [e for e in EFFECTS if not e.startswith("sensor.")]
    for effect in own:
        add(f"s_{effect}", "single", [(effect, None)])
    for effect in ("sensor.offset", "sensor.delay", "sensor.gain"):
        for signal in ("F_hat", "F_p", "x", "theta"):
            if (effect, signal) != ("sensor.offset", "x"):
                add(f"s_{effect}_{signal}", "single", [(effect, signal)], faint=bool(rng.random() < 0.5))
    fixed = ["act.gain", "act.delay", "act.deadband", "act.saturation", "act.hysteresis", "act.droop", "act.mode"]
    for effect in fixed:
        add(f"r_{effect}", "single", [(effect, None)], kind="actuator")
    sweeps = ["pf.viscous", "pf.coulomb", "pf.stribeck", "pf.presliding", "pf.offset", "pf.asymmetry", "cf.viscous", "cf.coulomb",
              "cf.stribeck", "cf.presliding", "cf.offset", "cf.asymmetry", "cf.poscoulomb", "cart.mass"]
    for effect in sweeps:
        add(f"w_{effect}", "single", [(effect, None)], kind="friction")
    for signal in ("F_p", "x", "v"):
        add(f"w_sensor.gain_{signal}", "single", [("sensor.gain", signal)], kind="friction", faint=True)
    for i in range(6):
        add(f"c_none_{i}", "control", [])
        add(f"c_few_{i}", "control", [], few=True)
        add(f"c_fixed_{i}", "control", [], kind="actuator")
        add(f"c_sweep_{i}", "control", [], kind="friction")
        add(f"c_off_{i}", "control", [], off=True)
    for i in range(12):
        while True:
            pair = rng.choice(own, 2, replace=False)
            if channel(pair[0]) != channel(pair[1]):
                break
        add(f"d{i:02d}_{pair[0]}_{pair[1]}", "double", [(e, None) for e in pair])
    for effect, (where, _) in OUTSIDE.items():
        add(f"o_{effect}", "outside", [(effect, None)], channel=where)
    for effect in own:
        add(f"f_{effect}", "few sensors", [(effect, None)], few=True)
    for effect in rng.choice(own, 12, replace=False):
        add(f"p_{effect}", "parameters off", [(effect, None)], off=True)
    for effect in rng.choice(own, 10, replace=False):
        add(f"b_{effect}", "first principles", [(effect, None)], fp=True)
    return cases


def other_cylinders(rng):
    """Cases on cylinders that nobody declares: a quarter more or less of every dimension, and what a fixed rod shows of them."""
    own = [e for e in EFFECTS if not e.startswith("sensor.")]
    cases = []
    for i, effect in enumerate([*rng.choice(own, 16, replace=False), None, None, None, None]):
        dimensions = {name: value * float(np.exp(0.25 * rng.uniform(-1.0, 1.0))) for name, value in CYLINDER.items()}
        dimensions["eta"] = float(rng.uniform(0.92, 0.99))
        dimensions["tdelay"] = round(dimensions["tdelay"], 4)
        cases.append(dict(name=f"k{i:02d}_{effect or 'none'}", cls="other cylinder" if effect else "other cylinder, control", kind="cartpole",
                          strengths=list(rng.uniform(*STRENGTH, 1)), fp=True, dimensions=dimensions, channel=None if effect else "actuator",
                          effects=[(effect, draw(rng, EFFECTS[effect]), None)] if effect else [], fixed_rod=chirps_and_stairs(rng, 2000),
                          figures=dimensions))
    return cases


def prepare(c, rng):
    """Everything of a case that is drawn."""
    c["noise"] = dict(u=0.0, F_hat=0.3, F_p=round(rng.uniform(0.24, 0.47), 2), x=1e-4, theta=0.00044, v=1e-3)
    c["units"] = {k: c["noise"][k] if c.get("faint") else UNITS[k] for k in UNITS}
    c["units"]["v"] = c["noise"]["v"]
    c["plant"] = {k: v * (1 + (rng.normal() * 0.01 if c.get("off") and v else 0.0)) for k, v in DECLARED.items()}
    if c["kind"] == "actuator":
        c["signals"], c["ff"] = ["u", "F_hat", "F_p"], chirps_and_stairs(rng)
        c["x0"], c["th0"], c["noise_x"] = np.zeros(5), np.zeros(5), np.zeros((8000, 5))
    elif c["kind"] == "cartpole":
        c["signals"] = ["u", "x", "theta"] if c.get("few") else ["u", "F_hat", "F_p", "x", "theta"]
        c["ff"] = np.repeat(commands(rng), 2, axis=0)
        c["x0"], c["th0"] = rng.normal(0, 0.003, 10), rng.normal(0, 0.015, 10)
        c["noise_x"] = rng.normal(0, 1e-4, (N, 10))
    else:
        c["signals"], c["motion"] = ["x", "v", "F_p"], rng.uniform(0, 1, (6, 13))
    c["seed"] = int(rng.integers(1 << 30))


def sweep_case(c, effects):
    """Noise-free signals of the six sweeps."""
    own = {e: p for e, p, s in effects if s is None}
    runs = [sweep(own, c["plant"], i >= 3, c["motion"][i]) for i in range(6)]
    return {k: np.array([r[k] for r in runs]).T for k in ("x", "v", "F_p")}


def files_of(c):
    """The files of a case: name, estimation, experiment, group."""
    if c["kind"] == "cartpole":
        return [(f"trial_{j + 1:02d}", j < 6, "coupled", f"command_{'abcde'[j // 2]}") for j in range(10)]
    if c["kind"] == "actuator":
        return [(name, estimation, "rod_fixed", name) for name, estimation in FIXED_FILES]
    return [(name, estimation, f"sweep_{name.split('_')[0]}", name) for name, estimation in SWEEP_FILES]


def measured(c, data):
    """What the sensors read: noise, and the counts of the encoder."""
    own, data = np.random.default_rng(c["seed"]), dict(data)
    if c["kind"] == "friction":
        return {k: v + own.normal(0, c["noise"][k], v.shape) for k, v in data.items()}
    for signal in ("F_hat", "F_p"):
        data[signal] = data[signal] + own.normal(0, c["noise"][signal], data[signal].shape)
    if c["kind"] == "cartpole":
        step, sensed_x = 2 * np.pi / 4096, any(s == "x" for _, _, s in c["effects"])
        data["x"] = data["x"] + (own.normal(0, 1e-4, data["x"].shape) if sensed_x else c["noise_x"])
        data["theta"] = np.round(data["theta"] / step) * step
    return data


def make_sweep(folder, c):
    """A case of friction sweeps: its one effect is scaled to its strength, then noise is added."""
    without, (effect, params, signal) = sweep_case(c, []), c["effects"][0] if c["effects"] else (None, {}, None)
    factor = 1.0
    for _ in range(4 if effect else 0):
        c["effects"] = [(effect, scaled(effect, params, factor), signal)]
        own = sensed(sweep_case(c, c["effects"]), c["effects"])
        reached = max(rms(own[k] - without[k]) / c["noise"][k] for k in without)
        factor *= np.clip(c["strengths"][0] / max(reached, 1e-3), 0.3, 3.0)
    write(folder, c, files_of(c), measured(c, sensed(sweep_case(c, c["effects"]), c["effects"])))
    np.savez_compressed(folder / c["name"] / "truth.npz", motion=c["motion"])


def make_runs(folder, cases):
    """Coupled and rod-fixed cases of one length and plant."""
    if not cases[0].get("fp") or cases[0].get("dimensions"):
        calibrate([c for c in cases if c["effects"]])
    count = len(cases[0]["ff"])
    while True:
        out, _ = run(cases, lambda c: c["effects"], list(range(count)))
        reached = [np.abs(out["x"][:, count * i:count * (i + 1)]).max() for i in range(len(cases))]
        beyond = [c for c, x in zip(cases, reached) if "dimensions" in c and not x < MOST_TRAVEL * c["dimensions"]["stroke"]]
        if not beyond:
            break
        for c in beyond:
            c["ff"] = 0.7 * c["ff"]
    for i, c in enumerate(cases):
        data = sensed({k: v[..., count * i:count * (i + 1)] for k, v in out.items()}, c["effects"])
        write(folder, c, files_of(c), measured(c, data))
        if c["kind"] == "cartpole":
            validation = slice(count * i + 6, count * (i + 1))
            np.savez_compressed(folder / c["name"] / "truth.npz", plant=np.array(list(c["plant"].values())),
                                states=out["states"][..., validation].astype(np.float32),
                                **{k: out[k][:, validation].astype(np.float32) for k in ("u", "F_hat", "F_p", "x", "theta")})


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="regular expression on the names")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    everything = specification(rng)
    for c in everything:
        prepare(c, rng)
    # Draws of their own: those of the other cases stay as they are.
    own_rng = np.random.default_rng([args.seed, 1])
    others = other_cylinders(own_rng)
    for c in others:
        prepare(c, own_rng)
    everything += others
    chosen = [c for c in everything if re.search(args.only, c["name"])]
    for c in chosen:
        if c["kind"] == "friction":
            make_sweep(args.folder, c)
        if "dimensions" in c:
            c["arx"] = identified(c["dimensions"], c["fixed_rod"])
    group = lambda c: (c["kind"], bool(c.get("fp")), "dimensions" in c)
    for own in sorted({group(c) for c in chosen if c["kind"] != "friction"}):
        cases = [c for c in chosen if group(c) == own]
        for start in range(0, len(cases), 40):
            make_runs(args.folder, cases[start:start + 40])


if __name__ == "__main__":
    main()
