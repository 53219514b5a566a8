"""Makes studies of machines that lack one law, with known truth: a mass on a spring that is slightly cubic, an electronic oscillator
with a cubic spring whose declared model is linear and free, two cascaded tanks with an overflow, and machines that lack nothing.

The true machines are typed here and integrated by a method of order 4 with eight steps per sample; the declared models become FMUs in C
(machines.py). Nothing of the library is used.

    python make_machines.py DIR [--seed S] [--count N] [--only REGEX]

A case DIR/NAME holds study.toml, its records and truth.json: the law, its parameters, and what a true model leaves on validation records.
"""

import argparse
import json
import pathlib
import re
import zlib

import numpy as np

import machines

STEPS = 8


def simulate(rate, y, u, h, after=lambda y: y):
    """States at the samples `[n, nx]` for inputs `u` that are held; `after`: what an overflow leaves of the states."""
    found = np.empty((len(u), len(y)))
    step = h / STEPS
    for k, own in enumerate(u):
        found[k] = y
        for _ in range(STEPS):
            a = rate(y, own)
            b = rate([s + 0.5 * step * d for s, d in zip(y, a)], own)
            c = rate([s + 0.5 * step * d for s, d in zip(y, b)], own)
            d = rate([s + step * d for s, d in zip(y, c)], own)
            y = after([s + step / 6 * (i + 2 * j + 2 * m + n) for s, i, j, m, n in zip(y, a, b, c, d)])
    return found


def multisine(rng, t, low, high, count=30, smooth=True):
    """Random-phase multisine of unit rms; `smooth`: it starts at zero."""
    f, phase = np.linspace(low, high, count) * (1 + 0.01 * rng.uniform(-1, 1, count)), rng.uniform(0, 2 * np.pi, count)
    y = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(f, phase)) * np.sqrt(2 / count)
    return y * np.minimum(t / (0.02 * t[-1]), 1.0) if smooth else y


def band_limited(rng, n, step, high):
    """Gaussian noise of unit rms below a frequency."""
    spectrum = np.fft.rfft(rng.standard_normal(n))
    spectrum[np.fft.rfftfreq(n, step) > high] = 0
    y = np.fft.irfft(spectrum, n)
    return y / y.std()


def rms(a):
    return float(np.sqrt(np.mean(np.square(a))))


def write(folder, index, columns):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(folder / f"r{index}.csv", rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")


def finish(folder, system, study, truth):
    path = folder / f"{system.name}.fmu"
    machines.write(system, path)
    (folder / "study.toml").write_text(f'name = "{folder.name}"\nsystem = "{path.name}"\n' + study)
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def segment(index, role, initial):
    return f'\n[[segment]]\nfile = "r{index}.csv"\nrole = "{role}"\ninitial = {initial}\n'


def bound(records, truth, free, noise):
    """Cramer-Rao bound of the first of some parameters: standard deviation for white noise."""
    columns = []
    for name in free:
        step = 1e-4 * abs(truth[name])
        a, b = (np.concatenate(records(truth | {name: truth[name] + s * step})) for s in (1, -1))
        columns.append((a - b) / (2 * step) / noise)
    j = np.array(columns)
    return float(np.sqrt(np.linalg.inv(j @ j.T)[0, 0]))


def spring(folder, rng, index, null):
    """A cubic spring takes 0.5 to 10 % of the spring force, or none; every third machine has declared values off by 1 %."""
    rate_hz = [100, 500, 1000][index % 3]
    part = 0.0 if null else float(np.exp(rng.uniform(np.log(0.005), np.log(0.1))))
    level = [3e-4, 1e-3, 1e-2][(index // 3) % 3]
    off = 0.01 if index % 4 == 3 else 0.0
    m, f0, zeta = rng.uniform(0.5, 3), rng.uniform(1.0, 4.0), rng.uniform(0.03, 0.2)
    declared = {"m": round(m, 4), "d": round(2 * zeta * m * 2 * np.pi * f0, 4), "k": round(m * (2 * np.pi * f0) ** 2, 3)}
    true = {name: value * (1 + off * rng.standard_normal()) for name, value in declared.items()} | {"c": 0.0}
    h = 1 / rate_hz
    t = np.arange(int(10 * rate_hz)) * h
    size = rng.uniform(5, 50)
    inputs = [np.round(size * multisine(rng, t, 0.2, 2 * f0), 5) for _ in range(4)]

    def run(p, u):
        m, d, k, c = p["m"], p["d"], p["k"], p["c"]
        return simulate(lambda y, f: (y[1], (f - d * y[1] - k * y[0] - c * y[0] ** 3) / m), [0.0, 0.0], u, h)[:, 0]

    for _ in range(3 if part else 0):
        x = np.concatenate([run(true, u) for u in inputs[:1]])
        true["c"] = part * true["k"] * rms(x) / rms(x**3)
    x = [run(true, u) for u in inputs]
    noise = level * rms(x[0])
    free = ["c", "m", "d", "k"] if off else ["c"]
    limit = bound(lambda p: [run(p, u) for u in inputs[:3]], true, free, noise) if part else 0.0
    for i, (u, own) in enumerate(zip(inputs, x)):
        write(folder, i, {"time": t, "force": u, "position": own + noise * rng.standard_normal(len(t))})
    study = '\n[inputs]\nF = { column = "force", unit = "N", hold = true }\n\n[outputs]\nx = { column = "position", unit = "m" }\n'
    study += "".join(segment(i, "estimation" if i < 3 else "validation", "{ x = 0.0, v = 0.0 }") for i in range(4))
    law = None if null else {"kind": "cubic", "c": true["c"], "deviation": limit}
    left = rms(run({**declared, "c": 0.0}, inputs[3]) - x[3])
    finish(folder, machines.spring(declared), study, dict(family="spring", law=law, part=part, rate=rate_hz, level=level, off=off, floor=noise, declared=left))


def oscillator(folder, rng, index, null):
    """Forced Duffing oscillator with a slightly quadratic term at 610 Hz; three test parts: growing noise, noise of one size,
    multisines."""
    rate_hz, f0, zeta = 610.35, rng.uniform(60, 75), rng.uniform(0.03, 0.06)
    gain = rng.uniform(1.0, 1.6)
    h, w = 1 / rate_hz, 2 * np.pi * f0
    # u = m y'' + d y' + k y + c y^3 + q y^2
    true = {"k": 1 / gain, "m": 1 / (gain * w * w), "d": 2 * zeta / (gain * w)}
    strength = 0.0 if null else rng.uniform(2.5, 5.0)
    true |= {"c": strength * true["k"], "q": 0.12 * strength * true["k"] * rng.uniform(-1, 1) * 0.5}
    size, count = 0.0223, 8192 if index % 2 else 16384
    noise = rng.uniform(3e-4, 4.5e-4)

    def run(u):
        m, d, k, c, q = (true[name] for name in "mdkcq")
        return simulate(lambda y, f: (y[1], (f - d * y[1] - k * y[0] - c * y[0] ** 3 - q * y[0] ** 2) / m), [0.0, 0.0], u, h)[:, 0]

    t = np.arange(count) * h
    estimation = [size * multisine(rng, t, 1.0, 200.0, 400) for _ in range(2)]
    n = 20000
    grow = 2.2 * size * band_limited(rng, n, h, 200.0) * np.linspace(0, 1, n)
    tests = [grow, size * band_limited(rng, 8192, h, 200.0), size * multisine(rng, t[:8192], 1.0, 200.0, 400)]
    inputs = [np.round(u, 7) for u in [*estimation, *tests]]
    outputs = [run(u) for u in inputs]
    for i, (u, y) in enumerate(zip(inputs, outputs)):
        write(folder, i, {"time": np.arange(len(u)) * h, "u": u, "y": y + noise * rng.standard_normal(len(u))})
    declared = {name: float(f"{true[name] * rng.uniform(0.8, 1.25):.4g}") for name in "mdk"}
    study = '\n[inputs]\nu = { column = "u", unit = "V", hold = true }\n\n[outputs]\ny = { column = "y", unit = "V" }\n'
    for name in "mdk":
        study += f'\n[[free]]\nparameter = "{name}"\nmin = {declared[name] / 5:.4g}\nmax = {declared[name] * 5:.4g}\n'
    roles = ["estimation"] * 2 + ["validation"] * 3
    study += "".join(segment(i, role, "{ y = 0.0, w = 0.0 }") for i, role in enumerate(roles))
    law = None if null else {"kind": "cubic", "c": true["c"], "q": true["q"]}
    finish(folder, machines.oscillator(declared), study, dict(family="oscillator", law=law, true=true, floor=noise, outputs=[rms(y) for y in outputs]))


def tanks(folder, rng, index, null):
    """Two cascaded tanks; the upper one is full at a level: what comes then runs over, a part of it into the lower one. The lower one
    is full at its level, too, and its sensor ends at 10 V."""
    exact, ports, kind = index % 2 == 0, (index // 2) % 2 == 1, ["overflow", "leak"][(index // 4) % 2]
    h = 4.0
    t = np.arange(1024) * h
    inputs = [np.round(np.clip(3.2 + rng.uniform(1.0, 1.4) * multisine(rng, t, 1e-4, 0.0144, 30, False), 0.2, 9.8), 4) for _ in range(2)]
    middle = rng.uniform(5.5, 7.5) if exact else rng.uniform(5.5, 6.5) if null else rng.uniform(7.6, 9.2)  # level of the upper tank for the mean of the command
    # Outlets and the pump of a machine are not quite those of the textbook.
    power, bend = (0.5, 0.0) if exact or null else (rng.uniform(0.48, 0.52), rng.uniform(-0.004, 0.004))
    true = {"c_p": rng.uniform(0.045, 0.06)}
    true["c_1"] = true["c_p"] * 3.2 / middle**power
    true["c_2"] = true["c_1"] * rng.uniform(0.9, 1.05)
    true["c_3"] = true["c_2"] / rng.uniform(0.85, 0.95)
    # Exact: between the middle and the highest levels; else the brim.
    level = middle + rng.uniform(0.8, 2.0) if exact else 10.0
    caught = 0.0 if exact else rng.uniform(0.3, 0.8)
    rate_over = rng.uniform(0.05, 0.12)

    def rate(y, u):
        h_1, h_2 = max(y[0], 0.0), max(y[1], 0.0)
        over = 0.0
        if not null:
            over = rate_over * max(h_1 - level, 0.0) if kind == "leak" or exact else 0.0
        fall = h_1**power
        return (true["c_p"] * (u + bend * u * u) - true["c_1"] * fall - over, true["c_2"] * fall + caught * over - true["c_3"] * h_2**power)

    brim = not exact and not null and kind == "overflow"

    def run(u, start):
        found, y = [], start
        step = h / (4 * STEPS)
        for own in u:
            found.append(y)
            for _ in range(4 * STEPS):
                a = rate(y, own)
                b = rate([s + 0.5 * step * d for s, d in zip(y, a)], own)
                y = [s + step * d for s, d in zip(y, b)]
                if brim and y[0] > level:
                    y = [level, y[1] + caught * (y[0] - level)]
                if brim and y[1] > 10.0:
                    y = [y[0], 10.0]
        return np.array(found)

    starts = [[rng.uniform(4, 9), rng.uniform(3, 7)] for _ in range(2)]
    states = [run(u, start) for u, start in zip(inputs, starts)]
    noise = 2e-3 if exact else 0.03
    for i, (u, y) in enumerate(zip(inputs, states)):
        shown = y[:, 1] + noise * rng.standard_normal(len(u))
        write(folder, i, {"time": t, "u": u, "level": shown if exact else np.minimum(shown, 10.0)})
    off = 0.0 if exact else 0.05
    p = {name: float(f"{value * (1 + off * rng.standard_normal()):.4g}") for name, value in true.items()} if off else true
    values = {"c_p": p["c_p"], "c_1": p["c_1"], "c_3": p["c_3"]} | ({"ratio": p["c_2"] / p["c_1"]} if ports else {"c_2": p["c_2"]})
    study = '\n[inputs]\nu = { column = "u", unit = "V", hold = true }\n\n[outputs]\nh_2 = { column = "level", unit = "V" }\n'
    for name in [] if exact else values:
        study += f'\n[[free]]\nparameter = "{name}"\nmin = {values[name] / 4:.4g}\nmax = {values[name] * 4:.4g}\n'
    study += "".join(segment(i, role, '"fit"') for i, role in enumerate(["estimation", "validation"]))
    law = None if null else {"kind": kind, "level": level, "rate": rate_over, "caught": caught, "brim": brim}
    over = float(np.mean(states[0][:, 0] > level - 1e-3))
    finish(folder, machines.cascade(values, ports), study, dict(family="tanks", law=law, exact=exact, ports=ports, floor=noise, over=over, true=true))


FAMILIES = {"spring": spring, "oscillator": oscillator, "tanks": tanks}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--count", type=int, default=12, help="cases of each family, with a law and without")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default=".", help="regular expression on the names of the cases")
    args = parser.parse_args()
    for family, make in FAMILIES.items():
        for null in (False, True):
            for index in range(args.count):
                name = f"{family}_{index:02d}{'_none' if null else ''}"
                if not re.search(args.only, name):
                    continue
                rng = np.random.default_rng([args.seed, zlib.crc32(name.encode())])
                folder = args.folder / name
                folder.mkdir(parents=True, exist_ok=True)
                make(folder, rng, index, null)
                print(name, flush=True)


if __name__ == "__main__":
    main()
