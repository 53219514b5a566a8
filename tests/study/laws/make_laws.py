"""Makes studies of systems that lack a law which no list holds, with known truth: a pendulum and a slow arm, six
families of laws, exact and messy records, and nulls.

Equations and noise are typed here; nothing of the library is used.

    python make_laws.py DIR [--count N] [--seed S]
"""

import argparse
import json
import pathlib

import numpy as np

RECORDS, ESTIMATION = 5, 3


def runge_kutta(rate, y, t, h):
    a = rate(t, y)
    b = rate(t + h / 2, y + h / 2 * a)
    c = rate(t + h / 2, y + h / 2 * b)
    d = rate(t + h, y + h * c)
    return y + h / 6 * (a + 2 * b + 2 * c + d)


def laws(family, size, rng):
    """(text, f(x, v, t, z), rates(x, v, t, z)) of a law; `size`: ranges of x and v, and the force that the law is to reach."""
    X, V, F = size
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
            w, p = u(1.5, 4.5), u(0, 1.5)
            return f"{F}*sin({w}*t + {p})", lambda x, v, t, z: F * np.sin(w * t + p), none
        tau = u(1.5, 4.0)
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


def pendulum(folder, law, noise, rng, messy, values, size, spread=0.004):
    """Driven pendulum or a slow arm; its damping and weight are declared with an error where the records are messy: `spread`, relative.
    Returns the study, states and law at every fifth sample, and the rms of the noise on the validation records."""
    (m, l, b), (g, h, n) = values, (9.81, 0.005, 2000)
    text, force, rates = law
    inertia = m * l * l
    off = (1 + spread * rng.standard_normal(2)) if messy else np.ones(2)
    points, floors = [], []
    for i in range(RECORDS):
        t = np.arange(n) * h
        u, y, found = drive(rng, t, size, (0.2, 1.6)), None, []
        for j in range(n):
            y = np.zeros(2 + len(rates(0, 0, 0, [0.0]))) if y is None else y
            found.append(y)

            def rate(time, y):
                f = force(y[0], y[1], time, y[2:])
                torque = u[j] - b * off[1] * y[1] - m * g * l * off[0] * np.sin(y[0]) - f
                return np.array([y[1], torque / inertia, *rates(y[0], y[1], time, y[2:])])

            y = runge_kutta(rate, runge_kutta(rate, y, t[j], h / 2), t[j] + h / 2, h / 2)
        found = np.array(found)
        added = noise * np.std(found[:, 0]) * rng.standard_normal(n)
        angle = found[:, 0] + added
        floors.append(float(np.mean(added**2)))
        write(folder, {"time": t, "torque": u, "angle": angle}, i)
        points += [[*row[:2], time, force(row[0], row[1], time, row[2:])] for row, time in zip(found, t)][::5]
    study = f'system = "airloop:pendulum"\n[parameters]\nm = {m}\nl = {l}\nI = {inertia}\nb = {b}\n'
    study += '[inputs]\ntau_ext = { column = "torque", hold = true }\n[outputs]\ntheta = { column = "angle", unit = "rad" }\n'
    study += '[[attachment]]\ninput = "tau_ext"\nchannels = ["pole"]\nvelocity = "omega"\nposition = "theta"\n'
    return study + segments("theta = 0.0, omega = 0.0"), points, float(np.sqrt(np.mean(floors[ESTIMATION:])))


# Mass [kg], length [m], damping [N m s/rad] and drive [N m]; ranges of angle and speed, torque of a law.
SYSTEMS = {
    "pendulum": (((0.4, 0.25, 0.02), 0.1), (0.5, 2.5, 0.08)),
    "arm": (((2.0, 0.4, 0.6), 2.0), (0.5, 2.0, 1.0)),
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=60, help="cases with a law")
    parser.add_argument("--nulls", type=int, help="cases without, half of the messy ones with declared values off by 1.5 %%; default: a third")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    cases = [(FAMILIES[i % 6], list(SYSTEMS)[(i // 6) % 2], (i // 12) % 2 == 1) for i in range(args.count)]
    cases += [("null", list(SYSTEMS)[i % 2], (i // 2) % 2 == 1) for i in range(args.nulls if args.nulls is not None else max(1, args.count // 3))]
    for i, (family, system, messy) in enumerate(cases):
        (values, driven), size = SYSTEMS[system]
        strength = rng.uniform(0.3, 1.0)
        none = ("0", lambda x, v, t, z: 0.0, lambda x, v, t, z: [])
        law = none if family == "null" else laws(family, (*size[:2], strength * size[2]), rng)
        folder = args.folder / f"{i:03d}_{family}_{system}_{'messy' if messy else 'exact'}"
        folder.mkdir(parents=True, exist_ok=True)
        spread = 0.015 if family == "null" and (i // 4) % 2 else 0.004
        study, points, floor = pendulum(folder, law, 0.02 if messy else 1e-3, rng, messy, values, driven, spread)
        (folder / "study.toml").write_text(f'name = "{folder.name}"\n' + study)
        truth = {"family": family, "system": system, "messy": messy, "law": law[0], "floor": floor, "points": np.round(points, 9).tolist()}
        (folder / "truth.json").write_text(json.dumps(truth))


if __name__ == "__main__":
    main()
