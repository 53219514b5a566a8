"""Makes measured sets of systems other than the rig, with known truth: free pendulums, linear axes, piston seals and
actuators alone, in the layout of measured data (`dataset.toml`) or with a `study.toml`.

Equations and noise are typed here; nothing of the library is used. Effects act alone and in pairs, at strengths from just
above the noise to many times it; controls have none, and some sets hold what the vocabulary does not know.

    python make_systems.py DIR [--seed S] [--only WORD,WORD]
"""
import argparse
import pathlib

import numpy as np

LAYOUT = """name = "{name}"

[units]
{units}

[parameters]
{parameters}
"""


def table(folder, name, columns, digits):
    """A CSV with `time` first."""
    names = list(columns)
    rows = zip(*columns.values())
    text = ",".join(names) + "\n" + "".join(",".join(f"{v:.{d}f}" for v, d in zip(row, digits)) + "\n" for row in rows)
    (folder / name).write_text(text)


def dataset(folder, units, parameters, segments):
    lines = "\n".join(f'{k} = {{ unit = "{u}" }}' for k, u in units.items())
    values = "\n".join(f'{k} = {{ value = {v!r}, unit = "{u}" }}' for k, (v, u) in parameters.items())
    text = LAYOUT.format(name=folder.name, units=lines, parameters=values)
    for file, role, start, stop in segments:
        text += f'\n[[segment]]\nfile = "{file}"\nrole = "{role}"\nfrom_s = {start!r}\nto_s = {stop!r}\n'
    (folder / "dataset.toml").write_text(text)


def truth(folder, verdict, effects=(), channel="", variables=()):
    text = f'verdict = "{verdict}"\neffects = {list(effects)!r}\nchannel = "{channel}"\nvariables = {list(variables)!r}\n'
    (folder / "truth.toml").write_text(text.replace("'", '"'))


def runge_kutta(rate, y, t, h):
    a = rate(t, y)
    b = rate(t + h / 2, y + h / 2 * a)
    c = rate(t + h / 2, y + h / 2 * b)
    d = rate(t + h, y + h * c)
    return y + h / 6 * (a + 2 * b + 2 * c + d)


def free_motion(rate, start, stop, step, inner):
    """States `[n, len(start)]` at multiples of `step`."""
    y, found = np.array(start, float), []
    for k in range(round(stop / step) + 1):
        found.append(y)
        for j in range(inner):
            y = runge_kutta(rate, y, (k + j / inner) * step, step / inner)
    return np.array(found)


# ---------------------------------------------------------------------------------------------------------- pendulum

PENDULUM = {  # effects: dry torque, drag, torque of a cable (outside), cubic damping (outside), as shares of b
    "none": {},
    "dry": {"pole.coulomb": 1.0},
    "drag": {"pole.quaddrag": 1.0},
    "both": {"pole.coulomb": 1.0, "pole.quaddrag": 1.0},
    "cable": {"outside theta": 1.0},
    "late": {"outside time": 1.0},
}


def pendulum(folder, rng, kind, strength):
    """Strength: 1 is a few times the noise of a coarse encoder, 10 what real pendulums show."""
    mass, distance = rng.uniform(0.05, 0.5), rng.uniform(0.1, 0.4)
    inertia = mass * distance**2 * rng.uniform(1.02, 1.4)
    w = np.sqrt(mass * 9.81 * distance / inertia)
    b = inertia * rng.uniform(0.01, 0.05)
    size = {k: strength for k in PENDULUM[kind]}
    dry = size.get("pole.coulomb", 0) * inertia * rng.uniform(3e-4, 8e-4) * w**2 * 0.1
    drag = size.get("pole.quaddrag", 0) * inertia * rng.uniform(4e-4, 1e-3)
    cable = size.get("outside theta", 0) * inertia * w**2 * 1e-3
    late = size.get("outside time", 0) * b * 0.05
    edge = 0.05 if rng.random() < 0.5 else 0.01

    def rate(t, y):
        theta, omega = y
        friction = (b + late * np.sin(2 * np.pi * t / 15)) * omega + dry * np.tanh(omega / edge) + drag * abs(omega) * omega
        return np.array([omega, (-friction - cable * np.sin(3 * theta) - mass * 9.81 * distance * np.sin(theta)) / inertia])

    step, quantum, noise = rng.choice([0.002, 0.005, 0.01]), rng.choice([1.57e-4, 5e-4, 1e-3]), rng.choice([0.0, 2e-4, 5e-4])
    bias = rng.uniform(-0.02, 0.02)

    def record(name, theta, stop):
        y = free_motion(rate, [theta, rng.uniform(-0.3, 0.3)], stop, step, 2)[:, 0]
        y = np.round((y + bias + noise * rng.standard_normal(len(y))) / quantum) * quantum
        table(folder, name, {"time": np.arange(len(y)) * step, "angle": y}, [3, 7])

    long = rng.uniform(25, 45)
    record("swing.csv", rng.uniform(0.9, 1.8) * rng.choice([-1, 1]), long)
    record("tail.csv", rng.uniform(0.1, 0.3), 8.0)
    parameters = {"gravity": (9.81, "m/s2"), "mass": (float(mass), "kg"), "com_distance": (float(distance), "m")}
    if rng.random() < 0.5:
        parameters["inertia_com"] = (float((inertia - mass * distance**2) * rng.uniform(0.5, 1.5)), "kg m2")
    cut = float(round(0.6 * long, 2))
    segments = [("swing.csv", "train", 0.0, cut), ("swing.csv", "validation", cut, float(round(long - 0.02, 2))), ("tail.csv", "validation", 0.0, 8.0)]
    dataset(folder, {"time": "s", "angle": "rad"}, parameters, segments)
    effects = [k for k in size if not k.startswith("outside")]
    outside = [k for k in size if k.startswith("outside")]
    truth(folder, "unexplained" if outside else "effect" if effects else "none", effects, "pole" if outside else "", [k.split()[1] for k in outside])


# -------------------------------------------------------------------------------------------------------------- axis

AXIS = {
    "none": [],
    "dry": ["cf.coulomb"],
    "dry and bias": ["cf.coulomb", "cf.offset"],
    "direction": ["cf.coulomb", "cf.asymmetry"],
    "stribeck": ["cf.coulomb", "cf.stribeck"],
    "place": ["cf.coulomb", "cf.poscoulomb"],
    "spring": ["cart.spring"],
    "cogging": ["cart.cogging"],
    "dry and cogging": ["cf.coulomb", "cart.cogging"],
    "drag": ["outside xdot"],
    "wave": ["outside time"],
}


def axis(folder, rng, kind, strength):
    mass, b = rng.uniform(2, 120), rng.uniform(5, 20)
    b *= mass / 10
    effects = AXIS[kind]
    force = mass * rng.uniform(0.15, 0.3) * strength
    level = force if "cf.coulomb" in effects else 0.0
    bias = 0.4 * force if "cf.offset" in effects else 0.0
    forward = 0.5 * force if "cf.asymmetry" in effects else 0.0
    peak = 1.0 * force if "cf.stribeck" in effects else 0.0
    slope = 2.5 * force if "cf.poscoulomb" in effects else 0.0
    stiffness = 8 * force if "cart.spring" in effects else 0.0
    wave = 0.6 * force if "cart.cogging" in effects else 0.0
    drag = 12 * force if "outside xdot" in effects else 0.0
    drift = 0.6 * force if "outside time" in effects else 0.0
    period, phase = rng.uniform(0.02, 0.06), rng.uniform(0, 6)

    def friction(t, x, v):
        s = np.tanh(v / 1e-3)
        f = b * v + (level + slope * x) * s + bias + np.where(v > 0, forward * s, 0) + peak * np.exp(-((v / 0.02) ** 2)) * s
        return f + stiffness * (x - 0.05) + wave * np.sin(2 * np.pi * x / period + phase) + drag * abs(v) * v + drift * np.sin(2 * np.pi * t / 7)

    step = rng.choice([0.001, 0.002])
    noise, quantum = rng.choice([5e-7, 2e-6, 5e-6]), rng.choice([1e-7, 1e-6])
    bandwidth = rng.uniform(6, 12)

    def record(name, stop, pulses):
        n = round(stop / step) + 1
        reference, place, velocity = np.zeros(n), 0.0, 0.0
        # Trapezoids of velocity between 0 and 0.24 m with pauses.
        top, rise = rng.uniform(0.06, 0.15), rng.uniform(0.15, 0.4)
        goal, k = 0.24, 0
        while k < n:
            cruise = max(abs(goal - place) / top - rise, 0.0)
            for t in np.arange(0, cruise + 2 * rise + 0.3, step):
                if k >= n:
                    break
                velocity = top * max(0.0, min(1.0, t / rise, (cruise + 2 * rise - t) / rise)) * np.sign(goal - place if k == 0 else direction) if t else 0.0
                if t == 0:
                    direction = np.sign(goal - place)
                reference[k] = reference[k - 1] + velocity * step if k else place
                k += 1
            place = reference[k - 1]
            goal = 0.0 if goal else rng.uniform(0.15, 0.24)
        soft = np.ones(round(0.04 / step)) / round(0.04 / step)
        reference = np.convolve(np.pad(reference, len(soft), mode="edge"), soft, mode="same")[len(soft) : len(soft) + n]
        kp, kd = mass * bandwidth**2 * 10, mass * bandwidth * 6
        y, u, x = np.zeros(2), np.zeros(n), np.zeros(n)
        for k in range(n):
            x[k] = y[0]
            rate_ref = (reference[min(k + 1, n - 1)] - reference[k]) / step
            u[k] = kp * (reference[k] - y[0]) + kd * (rate_ref - y[1])
            if pulses and (k * step) % 2.0 < 0.1:
                u[k] += 0.8 * mass
            held = np.round(u[k], 4)
            for j in range(3):
                y = runge_kutta(lambda t, y: np.array([y[1], (held - friction(t, y[0], y[1])) / mass]), y, (k + j / 3) * step, step / 3)
        x = np.round((x + noise * rng.standard_normal(n)) / quantum) * quantum
        table(folder, name, {"time": np.arange(n) * step, "force": u, "position": x, "reference": reference}, [3, 4, 8, 8])

    record("estimation.csv", 16.2, False)
    record("validation.csv", 12.2, True)
    dataset(folder, {"time": "s", "force": "N", "position": "m", "reference": "m"}, {}, [("estimation.csv", "train", 0.0, 16.0), ("validation.csv", "validation", 0.0, 12.0)])
    inside = [e for e in effects if not e.startswith("outside")]
    outside = [e for e in effects if e.startswith("outside")]
    channel = "cart_friction" if "outside xdot" in outside else "cart"
    truth(folder, "unexplained" if outside else "effect" if inside else "none", inside, channel if outside else "", [e.split()[1] for e in outside])


# -------------------------------------------------------------------------------------------------------------- seal

SEAL = {
    "none": [],
    "pressure": ["pf.pressure"],
    "area": ["act.area"],
    "both": ["pf.pressure", "act.area"],
    "presliding": ["pf.presliding"],
    "stribeck": ["pf.stribeck"],
    "direction": ["pf.asymmetry"],
    "place": ["outside x"],
}


def seal(folder, rng, kind, strength):
    bore = rng.uniform(0.015, 0.04)
    area = np.pi / 4 * bore**2
    c1, c4, c5 = rng.uniform(2, 8), rng.uniform(20, 80), rng.uniform(-1, 1)
    effects = SEAL[kind]
    has = lambda e: strength if e in effects else 0.0
    growth, wrong = has("pf.pressure") * rng.uniform(0.003, 0.008), has("act.area") * area * rng.uniform(0.003, 0.008)
    disp = 4e-4 * strength if "pf.presliding" in effects else 0.0
    peak, vs = has("pf.stribeck") * 1.0, 2e-3
    forward, place = has("pf.asymmetry") * 0.6, has("outside x") * 0.4
    grid = rng.choice([0.005, 0.01])
    segments = []

    def record(name, pressure, role):
        fine = 1e-3
        speed, stop = rng.uniform(0.006, 0.015), rng.uniform(35, 60)
        t = np.arange(0, stop, fine)
        travel, rest = 0.04, 0.2
        cycle = 2 * (travel / speed + rest)
        s = t % cycle
        v = np.where(s < travel / speed, speed, np.where((s >= cycle / 2) & (s < cycle / 2 + travel / speed), -speed, 0.0))
        ramp = np.ones(400) / 400
        v = np.convolve(v, ramp, mode="same")
        x = 0.004 + np.cumsum(v) * fine
        p = pressure * (1 + 0.01 * np.sin(2 * np.pi * t / 9) + 0.01 * np.sign(v)) + 300 * np.interp(t, np.arange(0, stop + 1, 0.5), rng.standard_normal(len(np.arange(0, stop + 1, 0.5))))
        out = -v  # positive in the direction of the pressure force
        sign = np.tanh(1000 * out)
        if disp:
            z, f1 = 0.0, np.zeros(len(t))
            for k in range(len(t)):
                f1[k] = c1 * z / disp
                end = disp * np.sign(out[k])
                z = z if out[k] == 0 else end + (z - end) * np.exp(-abs(out[k]) * fine / disp)
        else:
            f1 = c1 * sign
        f = f1 + c4 * out + c5 + growth * area * p * sign + peak * np.exp(-((out / vs) ** 2)) * sign
        f = f + np.where(out > 0, forward * sign, 0) + place * np.sin(2 * np.pi * x / 0.03)
        force = (area + wrong) * p - f
        # Sampling with jitter and some long steps.
        steps = grid * rng.choice([0.9, 1.0, 1.0, 1.1, 1.3], size=len(t))
        steps[rng.random(len(steps)) < 0.004] = 6 * grid
        at = np.cumsum(steps)
        at = np.round(at[at < stop - 0.01], 3)
        pick = lambda y: np.interp(at, t, y)
        table(folder, name, {
            "time": at - at[0],
            "position": np.round((pick(x) + 1e-5 * rng.standard_normal(len(at))) / 1e-6) * 1e-6,
            "pressure": np.round((pick(p) + 100 * rng.standard_normal(len(at))) / 100) * 100,
            "force": np.round((pick(force) + 0.05 * rng.standard_normal(len(at))) / 0.01) * 0.01,
        }, [3, 6, 0, 3])
        segments.append((name, role, 1.0, float(round(at[-1] - at[0] - 0.1, 2))))

    for level, role in zip([1, 3, 7, 5], ["train", "train", "train", "validation"]):
        record(f"p{level}.csv", level * 1e5 * rng.uniform(0.95, 1.05), role)
    units = {"time": "s", "position": "m", "pressure": "Pa", "force": "N"}
    dataset(folder, units, {"bore_diameter": (float(bore), "m")}, segments)
    inside = [e for e in effects if not e.startswith("outside")]
    outside = [e for e in effects if e.startswith("outside")]
    truth(folder, "unexplained" if outside else "effect" if inside else "none", inside, "piston_friction" if outside else "", [e.split()[1] for e in outside])


# ---------------------------------------------------------------------------------------------------------- actuator

ACTUATOR = {
    "none": [],
    "gain": ["act.gain"],
    "delay": ["act.delay"],
    "deadband": ["act.deadband"],
    "saturation": ["act.saturation"],
    "play": ["act.hysteresis"],
    "droop": ["act.droop"],
    "mode": ["act.mode"],
    "offset": ["sensor.offset"],
    "square": ["outside u"],
}

STUDY = """name = "{name}"
system = "airloop:arx-actuator"

[parameters]
realization = "sampled"

[inputs]
u = {{ column = "u", unit = "N", hold = true }}

[outputs]
F_hat = {{ column = "F_hat", unit = "N" }}
F_act = {{ column = "F_act", unit = "N" }}
{segments}
[[attachment]]
input = "u"
channels = ["actuator"]
"""


def actuator(folder, rng, kind, strength):
    A = np.array([[-1.0144, 0.0216], [-0.0527, -0.9537]])
    B0, B1 = np.array([0.6619, 0.0764]), np.array([-0.6557, -0.0847])
    effects, step = ACTUATOR[kind], 1e-3
    noise = 0.3
    size = strength

    def command(n):
        t = np.arange(n) * step
        f, phase = rng.uniform(0.3, 6.0, 6), rng.uniform(0, 2 * np.pi, 6)
        u = np.sin(2 * np.pi * f[:, None] * t + phase[:, None]).sum(0) * (1 - np.exp(-t / 0.1))
        return u * 40 / abs(u).max()

    def behind(u):
        n, t = len(u), np.arange(len(u)) * step
        if "act.gain" in effects:
            return u * (1 + 0.03 * size)
        if "act.delay" in effects:
            return np.interp(t - 0.0015 * size, t, u, left=0.0)
        if "act.deadband" in effects:
            width = 1.0 * size
            return u - np.clip(u, -width, width)
        if "act.saturation" in effects:
            limit = 40 - 4 * size
            return np.clip(u, -limit, limit)
        if "act.hysteresis" in effects:
            out, width, found = 0.0, 0.6 * size, np.zeros(n)
            for k in range(n):
                out = found[k] = min(max(out, u[k] - width), u[k] + width)
            return found
        if "act.droop" in effects:
            return u * (1 - 0.06 * size * (1 - np.exp(-t / 1.5)))
        if "act.mode" in effects:
            w, zeta, y, v, found = 2 * np.pi * 60 / size, 0.5, 0.0, 0.0, np.zeros(n)
            for k in range(n):
                found[k] = y
                for _ in range(10):
                    v += step / 10 * (w * w * (u[k] - y) - 2 * zeta * w * v)
                    y += step / 10 * v
            return found
        if "outside u" in effects:
            return u + 0.002 * size * u * abs(u) ** 0.5 * np.sign(np.sin(np.pi * u / 15))
        return u

    text = ""
    for k, role in enumerate(["estimation"] * 4 + ["validation"] * 2):
        u = np.round(command(3000), 4)
        e, z, last, y = behind(u), np.zeros(2), 0.0, np.zeros((len(u), 2))
        for i in range(len(u)):
            z = y[i] = -A @ z + B0 * e[i] + B1 * last
            last = e[i]
        y = y + noise * rng.standard_normal(y.shape)
        if "sensor.offset" in effects:
            y[:, 1] += 0.15 * size
        table(folder, f"trial_{k}.csv", {"time": np.arange(len(u)) * step, "u": u, "F_hat": y[:, 0], "F_act": y[:, 1]}, [3, 4, 4, 4])
        text += f'\n[[segment]]\nfile = "trial_{k}.csv"\nrole = "{role}"\n'
    (folder / "study.toml").write_text(STUDY.format(name=folder.name, segments=text))
    inside = [e for e in effects if not e.startswith("outside")]
    outside = [e for e in effects if e.startswith("outside")]
    truth(folder, "unexplained" if outside else "effect" if inside else "none", inside, "actuator" if outside else "", [e.split()[1] for e in outside])


FAMILIES = {
    "pendulum": (pendulum, PENDULUM, [1.0, 5.0, 20.0]),
    "axis": (axis, AXIS, [0.05, 0.4, 1.0]),
    "seal": (seal, SEAL, [0.5, 1.0, 2.5]),
    "actuator": (actuator, ACTUATOR, [1.0, 3.0]),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    words = [word for word in arguments.only.split(",") if word]
    number = 0
    for family, (make, kinds, strengths) in FAMILIES.items():
        for kind in kinds:
            for repeat, strength in enumerate(strengths):
                number += 1
                name = f"{family}_{kind.replace(' ', '_')}_{repeat + 1}"
                if words and not any(word in name for word in words):
                    continue
                folder = arguments.folder / name
                folder.mkdir(parents=True, exist_ok=True)
                make(folder, np.random.default_rng([arguments.seed, number]), kind, strength)


if __name__ == "__main__":
    main()
