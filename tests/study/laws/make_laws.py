"""Makes studies of systems that lack a law which no list holds, with known truth: a pendulum, a slow arm, a mass on a spring and a tank;
six families of laws (those of a tank: over level and time), exact and messy records, and nulls.

Equations and noise are typed here; nothing of the library is used. The declared models of mass and tank become FMUs in C (machines.py).

    python make_laws.py DIR [--count N] [--seed S]
"""

import argparse
import dataclasses
import json
import pathlib

import numpy as np

import machines

RECORDS, ESTIMATION, SAMPLES = 5, 3, 2000


def runge_kutta(rate, y, t, h):
    a = rate(t, y)
    b = rate(t + h / 2, y + h / 2 * a)
    c = rate(t + h / 2, y + h / 2 * b)
    d = rate(t + h, y + h * c)
    return y + h / 6 * (a + 2 * b + 2 * c + d)


def laws(family, size, rng):
    """(text, f(x, v, t, z), rates(x, v, t, z)) of a law; `size`: ranges of x and v, the force that the law is to reach, and duration."""
    X, V, F, T = size
    u, pick = rng.uniform, lambda *options: options[rng.integers(len(options))]
    none = lambda x, v, t, z: []  # noqa: E731
    if family == "position":
        kind = pick("cubic", "sine", "bump", "fifth")
        if kind == "cubic":
            a = F / X**3
            return f"{a}*x^3", lambda x, v, t, z: a * x**3, none
        if kind == "fifth":
            a = F / X**5
            return f"{a}*x^5", lambda x, v, t, z: a * x**5, none
        if kind == "sine":
            q, p = u(1.2, 3.0) * np.pi / X, u(0, 1.5)
            return f"{F}*sin({q}*x + {p})", lambda x, v, t, z: F * np.sin(q * x + p), none
        m, w = u(-0.3, 0.3) * X, u(0.2, 0.4) * X
        return f"{F}*exp(-((x - {m})/{w})^2)", lambda x, v, t, z: F * np.exp(-(((x - m) / w) ** 2)), none
    if family == "velocity":
        kind = pick("cubic", "fifth", "bump")
        if kind == "cubic":
            a = F / V**3
            return f"{a}*v^3", lambda x, v, t, z: a * v**3, none
        if kind == "fifth":
            a = F / V**5
            return f"{a}*v^5", lambda x, v, t, z: a * v**5, none
        m, w = u(0.2, 0.5) * V, u(0.15, 0.3) * V
        return f"{F}*exp(-((v - {m})/{w})^2)", lambda x, v, t, z: F * np.exp(-(((v - m) / w) ** 2)), none
    if family == "product":
        kind = pick("x2v", "xv", "absxv")
        if kind == "x2v":
            a = 3 * F / (X**2 * V)
            return f"{a}*x^2*v", lambda x, v, t, z: a * x**2 * v, none
        if kind == "xv":
            a = 2 * F / (X * V)
            return f"{a}*x*v", lambda x, v, t, z: a * x * v, none
        a = 2 * F / (X * V)
        return f"{a}*abs(x)*v", lambda x, v, t, z: a * abs(x) * v, none
    if family == "memory":
        kind = pick("maxwell", "bristle")
        if kind == "maxwell":
            a, tau = F / X, u(0.2, 0.6)
            return f"{a}*z, z = v - z/{tau}", lambda x, v, t, z: a * z[0], lambda x, v, t, z: [v - z[0] / tau]
        d = u(0.1, 0.3) * X
        return f"{F / d}*z, z = v - abs(v)*z/{d}", lambda x, v, t, z: F / d * z[0], lambda x, v, t, z: [v - abs(v) * z[0] / d]
    if family == "time":
        kind = pick("sine", "decay")
        if kind == "sine":
            w, p = u(15, 45) / T, u(0, 1.5)
            return f"{F}*sin({w}*t + {p})", lambda x, v, t, z: F * np.sin(w * t + p), none
        tau = u(0.15, 0.4) * T
        return f"{F}*exp(-t/{tau})", lambda x, v, t, z: F * np.exp(-t / tau), none
    m = u(0.2, 0.5) * X  # threshold
    kind = pick("ramp", "square", "below")
    if kind == "ramp":
        a = F / (X - m)
        return f"{a}*max(0, x - {m})", lambda x, v, t, z: a * max(0.0, x - m), none
    if kind == "square":
        a = F / (X - m) ** 2
        return f"{a}*max(0, x - {m})^2", lambda x, v, t, z: a * max(0.0, x - m) ** 2, none
    a = F / (X - m)
    return f"{a}*max(0, {-m} - x)", lambda x, v, t, z: a * max(0.0, -m - x), none


FAMILIES = ["position", "velocity", "product", "memory", "time", "threshold"]


def drive(rng, t, size, band):
    return sum(rng.uniform(0.3, 1.0) * size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in rng.uniform(*band, 4))


def write(folder, columns, index, digits=8):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / f"r{index}.csv", rows, delimiter=",", header=",".join(columns), comments="", fmt=f"%.{digits}f")


def segments(initial):
    role = lambda i: "estimation" if i < ESTIMATION else "validation"  # noqa: E731
    return "".join(f'\n[[segment]]\nfile = "r{i}.csv"\nrole = "{role(i)}"\ninitial = {{ {initial} }}\n' for i in range(RECORDS))


@dataclasses.dataclass
class System:
    """A true machine and its declared model.

    `rates(y, u, f, off)`: derivatives of the first states under the input and the law's force, with the relative errors `off` of two
    declared values; `start`: states; `drive`: mean, size and band [Hz] of the input; `step` [s]; `size`: ranges of x and v and the
    force of a law; `study(folder)`: the text above the segments, which writes the FMU where one is needed; `columns`: of input and
    output; `digits`: of the records."""

    rates: object
    start: list
    drive: tuple
    step: float
    size: tuple
    study: object
    columns: tuple
    initial: str
    digits: int = 8


def pendulum(m, l, b, driven, size):
    """Driven pendulum; mass [kg], length [m], damping [N m s/rad], drive [N m]. Damping and weight may be off."""
    g, inertia = 9.81, m * l * l

    def rates(y, u, f, off):
        return [y[1], (u - b * off[1] * y[1] - m * g * l * off[0] * np.sin(y[0]) - f) / inertia]

    def study(folder):
        text = f'system = "airloop:pendulum"\n[parameters]\nm = {m}\nl = {l}\nI = {inertia}\nb = {b}\n'
        text += '[inputs]\ntau_ext = { column = "torque", hold = true }\n[outputs]\ntheta = { column = "angle", unit = "rad" }\n'
        return text + '[[attachment]]\ninput = "tau_ext"\nchannels = ["pole"]\nvelocity = "omega"\nposition = "theta"\n'

    return System(rates, [0.0, 0.0], (0.0, driven, (0.2, 1.6)), 0.005, size, study, ("torque", "angle"), "theta = 0.0, omega = 0.0")


def spring(m, d, k, driven, size):
    """Mass on a spring with a damper; mass [kg], damping [N s/m], stiffness [N/m], drive [N]. Damping and stiffness may be off."""

    def rates(y, u, f, off):
        return [y[1], (u - d * off[1] * y[1] - k * off[0] * y[0] - f) / m]

    def study(folder):
        machines.write(machines.spring({"m": m, "d": d, "k": k}), folder / "spring.fmu")
        text = 'system = "spring.fmu"\n[inputs]\nF = { column = "force", unit = "N", hold = true }\n'
        return text + '[outputs]\nx = { column = "position", unit = "m" }\n'

    return System(rates, [0.0, 0.0], (0.0, driven, (0.2, 2.0)), 0.005, size, study, ("force", "position"), "x = 0.0, v = 0.0")


def tank(area, c, inflow, size):
    """Tank with an outlet; area [m2], outlet [m2.5/s], mean inflow [m3/s]. Outlet and pump may be off."""

    def rates(y, u, f, off):
        return [(u * off[1] - c * off[0] * np.sqrt(max(y[0], 0.0)) - f) / area]

    def study(folder):
        machines.write(machines.tank({"area": area, "c": c}), folder / "tank.fmu")
        text = 'system = "tank.fmu"\n[inputs]\nq = { column = "inflow", unit = "m3/s", hold = true }\n'
        return text + '[outputs]\nh = { column = "level", unit = "m" }\n'

    return System(rates, [0.3], (inflow, 0.35 * inflow, (0.0005, 0.01)), 0.5, size, study, ("inflow", "level"), "h = 0.3", 10)


def records(system, law, noise, rng, messy, spread):
    """Rows (time, input, output) of each record, states and law at every fifth sample, and the rms of the noise on validation records.
    Declared values of messy machines are off: `spread`, relative."""
    _, force, more = law
    mean, size, band = system.drive
    off = (1 + spread * rng.standard_normal(2)) if messy else np.ones(2)
    rows, points, floors, n = [], [], [], len(system.start)
    for _ in range(RECORDS):
        t = np.arange(SAMPLES) * system.step
        u, found = mean + drive(rng, t, size, band), []
        motion = lambda y: (y[0], y[1] if n > 1 else 0.0)  # noqa: E731
        y = np.array([*system.start, *(0.0 for _ in more(0, 0, 0, [0.0]))])
        for own, time in zip(u, t):
            found.append(y)

            def rate(time, y, own=own):
                z = y[n:]
                f = force(*motion(y), time, z)
                return np.array([*system.rates(y, own, f, off), *more(*motion(y), time, z)])

            y = runge_kutta(rate, runge_kutta(rate, y, time, system.step / 2), time + system.step / 2, system.step / 2)
        found = np.array(found)
        added = noise * np.std(found[:, 0]) * rng.standard_normal(SAMPLES)
        floors.append(float(np.mean(added**2)))
        rows.append((t, u, found[:, 0] + added))
        points += [[*motion(row), time, force(*motion(row), time, row[n:])] for row, time in zip(found, t)][::5]
    return rows, points, float(np.sqrt(np.mean(floors[ESTIMATION:])))


SYSTEMS = {
    "pendulum": pendulum(0.4, 0.25, 0.02, 0.1, (0.5, 2.5, 0.08)),
    "arm": pendulum(2.0, 0.4, 0.6, 2.0, (0.5, 2.0, 1.0)),
    "mass": spring(1.2, 2.0, 60.0, 4.0, (0.1, 0.7, 2.0)),
    "tank": tank(0.02, 3e-4, 2e-4, (0.6, 0.01, 5e-5)),
}
# A tank has no second state.
OF_TANK = {"velocity": "position", "product": "threshold", "memory": "time"}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=60, help="cases with a law")
    parser.add_argument("--nulls", type=int, help="cases without, half of the messy ones with declared values off by 1.5 %%; default: a third")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rng, names = np.random.default_rng(args.seed), list(SYSTEMS)
    cases = [(FAMILIES[i % 6], names[(i // 6) % 4], (i // 24) % 2 == 1) for i in range(args.count)]
    cases += [("null", names[i % 4], (i // 4) % 2 == 1) for i in range(args.nulls if args.nulls is not None else max(1, args.count // 3))]
    for i, (family, name, messy) in enumerate(cases):
        system = SYSTEMS[name]
        if name == "tank":
            family = OF_TANK.get(family, family)
        none = ("0", lambda x, v, t, z: 0.0, lambda x, v, t, z: [])
        spread = 0.015 if family == "null" and (i // 8) % 2 else 0.004
        while True:
            X, V, F = system.size
            size = (X, V, rng.uniform(0.3, 1.0) * F, SAMPLES * system.step)
            law = none if family == "null" else laws(family, size, rng)
            with np.errstate(all="ignore"):
                rows, points, floor = records(system, law, 0.02 if messy else 1e-3, rng, messy, spread)
            # Some laws drive the machine away, and some act nowhere.
            x, f = np.abs(np.array(points)[:, [0, 3]]).max(axis=0)
            if np.isfinite(points).all() and x < 20 * X and (family == "null" or f > 0.05 * size[2]):
                break
        folder = args.folder / f"{i:03d}_{family}_{name}_{'messy' if messy else 'exact'}"
        folder.mkdir(parents=True, exist_ok=True)
        for r, own in enumerate(rows):
            write(folder, dict(zip(("time", *system.columns), own)), r, system.digits)
        (folder / "study.toml").write_text(f'name = "{folder.name}"\n' + system.study(folder) + segments(system.initial))
        truth = {"family": family, "system": name, "messy": messy, "law": law[0], "floor": floor, "points": np.round(points, 12).tolist()}
        (folder / "truth.json").write_text(json.dumps(truth))


if __name__ == "__main__":
    main()
