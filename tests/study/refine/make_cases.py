"""Makes cases for the study of `airloop refine`: coupled trials of the rig with undeclared effects, alone, in pairs,
outside the vocabulary, with few sensors, with declared parameters off, on the first-principles actuator, and controls.

Independent of the library: the equations are typed here from the description of the effects, in NumPy, all trials of
all cases side by side; explicit Runge-Kutta of order 4 with 0.25 ms (the library: 0.5 ms), and another layout (rates of
separate arrays instead of a state record). Nothing of the library's effect code is used.

    python make_cases.py DIR [--seed S] [--only WORD]
"""
import argparse
import pathlib

import numpy as np

TS = 1e-3
N = 4000
SUB = 4
A1 = np.array([[-1.0144, 0.0216], [-0.0527, -0.9537]])
B0 = np.array([0.6619, 0.0764])
B1 = np.array([-0.6557, -0.0847])
DECLARED = dict(pc1=1.5145, pc2=40.8926, pc4=49.2734, cc1=5.7910, cc2=63.7045, cc3=0.0064, cc5=-2.3170,
                m_c=0.399, m_p=0.1, l=0.2, b_p=0.0006, act=1.0)
G, TIP = 9.81, 0.25

# effect -> parameters with ranges; a leading +- means either sign
EFFECTS = {
    "act.gain": dict(gain=("+-", 0.02, 0.08)),
    "act.delay": dict(delay=(0.0015, 0.008)),
    "act.deadband": dict(width=(0.4, 1.5)),
    "act.saturation": dict(limit=(20.0, 30.0)),
    "act.hysteresis": dict(width=(0.4, 1.5)),
    "act.posgain": dict(slope=("+-", 0.4, 1.2)),
    "act.backpressure": dict(coef=(2.0, 10.0)),
    "act.droop": dict(depth=(0.05, 0.2), tau=(0.5, 3.0)),
    "act.mode": dict(freq=(8.0, 30.0), zeta=(0.2, 0.9)),
    "pf.viscous": dict(coef=("+-", 2.0, 10.0)),
    "pf.coulomb": dict(force=(0.4, 1.5)),
    "pf.stribeck": dict(force=(0.6, 2.0), vs=(0.02, 0.15)),
    "pf.presliding": dict(disp=(0.0005, 0.003)),
    "pf.pressure": dict(coef=(0.02, 0.08)),
    "pf.offset": dict(value=("+-", 0.3, 1.2)),
    "pf.asymmetry": dict(force=(0.4, 1.5), coef=(1.0, 6.0)),
    "cf.viscous": dict(coef=(2.0, 10.0)),
    "cf.coulomb": dict(force=("+-", 0.4, 1.5)),
    "cf.stribeck": dict(force=(0.6, 2.0), vs=(0.02, 0.15)),
    "cf.presliding": dict(disp=(0.0005, 0.003)),
    "cf.offset": dict(value=("+-", 0.3, 1.2)),
    "cf.asymmetry": dict(force=(0.4, 1.5), coef=(1.0, 6.0)),
    "cf.poscoulomb": dict(slope=("+-", 8.0, 25.0)),
    "cart.mass": dict(mass=(0.02, 0.1)),
    "cart.spring": dict(stiffness=(8.0, 40.0), rest=(-0.02, 0.02)),
    "cart.endstop": dict(pos=(0.025, 0.05), stiffness=(100.0, 800.0), damping=(0.0, 5.0)),
    "cart.cogging": dict(amp=(0.4, 1.5), period=(0.01, 0.05), phase=(-3.0, 3.0)),
    "cart.tilt": dict(angle=("+-", 0.01, 0.05)),
    "pole.viscous": dict(coef=(2e-4, 1.5e-3)),
    "pole.coulomb": dict(torque=(0.001, 0.005)),
    "pole.quaddrag": dict(coef=(5e-5, 3e-4)),
    "pole.payload": dict(mass=(0.002, 0.015)),
    "pole.length": dict(delta=("+-", 0.003, 0.012)),
    "sensor.offset": dict(value=(1.0, 4.0)),
    "sensor.delay": dict(delay=(0.002, 0.01)),
    "sensor.gain": dict(gain=("+-", 0.02, 0.08)),
}
OFFSET_UNIT = {"F_hat": 0.3, "F_p": 0.3, "theta": 0.01}
OUTSIDE = {
    "out.bump": ("cart", dict(amp=(1.0, 3.0), at=(-0.02, 0.03), width=(0.004, 0.01))),
    "out.cubic": ("cart", dict(k3=(4e3, 1.5e4))),
    "out.magnet": ("pole", dict(torque=(0.006, 0.02), at=(0.2, 0.6), width=(0.08, 0.2))),
    "out.leak": ("actuator", dict(amp=(1.5, 4.0), f=(0.4, 1.3))),
    "out.pistonbump": ("piston_friction", dict(amp=(1.0, 3.0), at=(-0.02, 0.03), width=(0.005, 0.012))),
    "out.stick": ("cart_friction", dict(amp=(0.8, 2.0), v0=(0.1, 0.2), width=(0.03, 0.06))),
}


def channel(effect):
    head = effect.split(".")[0]
    return {"act": "actuator", "pf": "piston_friction", "cf": "cart_friction"}.get(head, head)


def draw(rng, ranges):
    found = {}
    for name, entry in ranges.items():
        sign = 1.0
        if entry[0] == "+-":
            sign, entry = rng.choice([-1.0, 1.0]), entry[1:]
        found[name] = sign * rng.uniform(*entry)
    return found


def commands(rng):
    """Five feed-forward commands: sums of sines up to 4 Hz, 30 to 55 N at most, from rest."""
    t = np.arange(N) * TS
    found = []
    for _ in range(5):
        f, phase, amp = rng.uniform(0.3, 4.0, 6), rng.uniform(0, 2 * np.pi, 6), rng.uniform(0.3, 1.0, 6)
        u = (amp[:, None] * np.sin(2 * np.pi * f[:, None] * t + phase[:, None])).sum(0) * (1 - np.exp(-t / 0.1))
        found.append(u * rng.uniform(30.0, 55.0) / np.abs(u).max())
    return np.array(found)


class Lanes:
    """Parameters of all trials side by side: p["cart.spring.stiffness"] has one entry per lane."""

    def __init__(self, effects):
        self.effects = effects
        self.count = len(effects)

    def get(self, effect, name, neutral=0.0):
        return np.array([e.get(effect, {}).get(name, neutral) for e in self.effects])

    def has(self, effect):
        return np.array([effect in e for e in self.effects])


def simulate(effects, ff, x0, th0, plant, noise_x, rng, firstprinciples=False):
    """All trials at once. effects: list of {effect: parameters}; ff [lanes, N]; plant: dict of arrays [lanes]."""
    p, n = Lanes(effects), len(effects)
    q = {k: np.asarray(v) for k, v in plant.items()}
    mass, mpl = q["m_c"] + q["m_p"] + p.get("cart.mass", "mass"), q["m_p"] * (q["l"] + p.get("pole.length", "delta"))
    inertia = q["m_p"] * (q["l"] + p.get("pole.length", "delta")) ** 2
    pay = p.get("pole.payload", "mass")
    mass, mpl, inertia = mass + pay, mpl + pay * TIP, inertia + pay * TIP**2
    bp = q["b_p"] + p.get("pole.viscous", "coef")
    tq, qd, tilt = p.get("pole.coulomb", "torque"), p.get("pole.quaddrag", "coef"), p.get("cart.tilt", "angle")
    k, rest = p.get("cart.spring", "stiffness"), p.get("cart.spring", "rest")
    sp, sk, sd = p.get("cart.endstop", "pos", 9.0), p.get("cart.endstop", "stiffness"), p.get("cart.endstop", "damping")
    ca, cper, cph = p.get("cart.cogging", "amp"), p.get("cart.cogging", "period", 1.0), p.get("cart.cogging", "phase")
    pv, pc = q["pc4"] + p.get("pf.viscous", "coef"), p.get("pf.coulomb", "force")
    ps, pvs = p.get("pf.stribeck", "force"), p.get("pf.stribeck", "vs", 1.0)
    pdisp, ppre = p.get("pf.presliding", "disp", 1.0), p.has("pf.presliding")
    pp, po = p.get("pf.pressure", "coef"), p.get("pf.offset", "value")
    paf, pac = p.get("pf.asymmetry", "force"), p.get("pf.asymmetry", "coef")
    cv, cc = p.get("cf.viscous", "coef"), p.get("cf.coulomb", "force")
    cs, cvs = p.get("cf.stribeck", "force"), p.get("cf.stribeck", "vs", 1.0)
    cdisp, cpre = p.get("cf.presliding", "disp", 1.0), p.has("cf.presliding")
    co, caf, cac = p.get("cf.offset", "value"), p.get("cf.asymmetry", "force"), p.get("cf.asymmetry", "coef")
    cpos = p.get("cf.poscoulomb", "slope")
    ba, bx, bw = p.get("out.bump", "amp"), p.get("out.bump", "at"), p.get("out.bump", "width", 1.0)
    k3 = p.get("out.cubic", "k3")
    ma, mt, mw = p.get("out.magnet", "torque"), p.get("out.magnet", "at"), p.get("out.magnet", "width", 1.0)
    la, lf = p.get("out.leak", "amp"), p.get("out.leak", "f")
    qa, qx, qw = p.get("out.pistonbump", "amp"), p.get("out.pistonbump", "at"), p.get("out.pistonbump", "width", 1.0)
    ta, tv, tw = p.get("out.stick", "amp"), p.get("out.stick", "v0"), p.get("out.stick", "width", 1.0)

    def piston(x, v, z, ph):
        s = np.tanh(q["pc2"] * v)
        f = q["pc1"] * np.where(ppre, z / pdisp, s) + pv * v
        f = f + pc * s + ps * np.exp(-(v / pvs) ** 2) * s + pp * np.abs(ph) * s + po + np.where(v > 0, paf * s + pac * v, 0.0)
        return f + qa * np.exp(-((x - qx) / qw) ** 2) * np.tanh(30 * v)

    def cart(x, v, z):
        w = v - q["cc3"]
        s = np.tanh(q["cc2"] * w)
        f = q["cc1"] * np.where(cpre, z / cdisp, s) + q["cc5"] + cv * v + cc * s + cs * np.exp(-(w / cvs) ** 2) * s + co
        f = f + np.where(v > 0, caf * s + cac * v, 0.0) + cpos * x * s
        return f + ta * np.exp(-((np.abs(v) - tv) / tw) ** 2) * np.sign(v)

    def rates(x, v, th, om, zp, zc, force, ph):
        f = force - piston(x, v, zp, ph) - cart(x, v, zc) - k * (x - rest) - mass * G * np.sin(tilt)
        f = f - np.where(x > sp, np.maximum(0.0, sk * (x - sp) + sd * v), 0.0) - ca * np.sin(2 * np.pi * x / cper + cph)
        f = f - ba * np.exp(-((x - bx) / bw) ** 2) - k3 * x**3 + mpl * om**2 * np.sin(th)
        t = -bp * om - mpl * G * np.sin(th + tilt) - tq * np.tanh(om / 0.05) - qd * np.abs(om) * om
        t = t - ma * np.exp(-((th - mt) / mw) ** 2)
        c = mpl * np.cos(th)
        det = mass * inertia - c * c
        w = v - q["cc3"]
        return (v, (f * inertia - c * t) / det, om, (mass * t - c * f) / det,
                np.where(ppre, v - np.abs(v) * zp / pdisp, 0.0), np.where(cpre, w - np.abs(w) * zc / cdisp, 0.0))

    delay, dead, lim = p.get("act.delay", "delay"), p.get("act.deadband", "width"), p.get("act.saturation", "limit", np.inf)
    hys, gain, posgain = p.get("act.hysteresis", "width"), p.get("act.gain", "gain"), p.get("act.posgain", "slope")
    back, depth, tau = p.get("act.backpressure", "coef"), p.get("act.droop", "depth"), p.get("act.droop", "tau", 1.0)
    mode, mf, mz = p.has("act.mode"), p.get("act.mode", "freq", 10.0), p.get("act.mode", "zeta", 1.0)
    mw2 = 2 * np.pi * mf
    s = [x0.copy(), np.zeros(n), th0.copy(), np.zeros(n), np.zeros(n), np.zeros(n)]
    y, ub, play = np.zeros((2, n)), np.zeros(n), np.zeros(n)
    m1, m2 = np.zeros(n), np.zeros(n)
    U = np.zeros((N + 64, n))
    out = {name: np.zeros((N, n)) for name in ("u", "F_hat", "F_p", "x", "theta")}
    fp = Pneumatic(n) if firstprinciples else None
    lanes = np.arange(n)
    for i in range(N):
        xm = s[0] + noise_x[i]
        u = np.round(ff[:, i] - 55.0 * xm, 3)
        U[i + 64] = u
        back_samples = delay / TS
        whole = np.floor(back_samples).astype(int)
        part = back_samples - whole
        ue = (1 - part) * U[i + 64 - whole, lanes] + part * U[i + 63 - whole, lanes]
        play = np.minimum(np.maximum(play, ue - hys), ue + hys)
        ue = play
        ue = ue - np.clip(ue, -dead, dead)
        ue = np.clip(ue, -lim, lim) * (1 + gain) * (1 + posgain * s[0]) * (1 - depth * (1 - np.exp(-i * TS / tau)))
        if mode.any():
            now = m1.copy()
            h = TS / 20
            for _ in range(20):
                a1, b1 = m2, mw2**2 * (ue - m1) - 2 * mz * mw2 * m2
                a2, b2 = m2 + h / 2 * b1, mw2**2 * (ue - m1 - h / 2 * a1) - 2 * mz * mw2 * (m2 + h / 2 * b1)
                m1, m2 = m1 + h * a2, m2 + h * b2
            ue = np.where(mode, now, ue)
        if fp is None:
            y = -(A1 @ y) + np.outer(B0, ue * q["act"]) + np.outer(B1, ub * q["act"])
            ub = ue
            fh, fa = y[0] - back * s[1] + la * np.sin(2 * np.pi * lf * i * TS), y[1] - back * s[1] + la * np.sin(2 * np.pi * lf * i * TS)
            out["F_hat"][i], out["F_p"][i] = fh, fa - piston(s[0], s[1], s[4], fh)
            steps, h = SUB, TS / SUB
        else:
            fp.command(ue)
            steps, h = 10, TS / 10
            fh = fp.f_hat()
            fa = fp.force()
            out["F_hat"][i], out["F_p"][i] = fh, fa - piston(s[0], s[1], s[4], fh)
        out["u"][i], out["x"][i], out["theta"][i] = u, s[0], s[2]
        for _ in range(steps):
            if fp is not None:
                fa = fp.force()
                fp.advance(s[0], s[1], h)
            k1 = rates(*s, fa, fh)
            k2 = rates(*[a + h / 2 * b for a, b in zip(s, k1)], fa, fh)
            k3_ = rates(*[a + h / 2 * b for a, b in zip(s, k2)], fa, fh)
            k4 = rates(*[a + h * b for a, b in zip(s, k3_)], fa, fh)
            s = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(s, k1, k2, k3_, k4)]
    return out


class Pneumatic:
    """Two chambers behind pressure valves and tubes (the first-principles actuator of the rig description)."""

    def __init__(self, n):
        self.S = np.pi / 4 * np.array([0.02**2, 0.02**2 - 0.008**2])[:, None] * np.ones((2, n))
        self.pa, self.ps = 101325.0, 0.5e6 + 101325.0
        self.p = 72.3 / self.S + self.pa
        self.feq = 0.25e6 * self.S.sum(0) / 2
        self.p = self.feq / self.S + self.pa
        self.pv, self.c, self.play = self.p.copy(), self.p.copy(), self.p.copy()
        self.q, self.s, self.w = np.zeros((2, n)), np.zeros((2, n)), np.zeros((2, n))
        self.line = [np.zeros((2, n)) for _ in range(30)]

    @staticmethod
    def psi(a, b):
        hi, lo = np.maximum(a, b), np.minimum(a, b)
        r = lo / hi
        k = 1.4
        f = lambda r: 0.156174 * r ** (1 / k) * np.sqrt(np.maximum(0.0, 1 - r ** ((k - 1) / k)))
        flow = np.where(r <= 0.528, 0.040418, np.where(r < 0.995, f(r), f(0.995) * (1 - r) / 0.005))
        return np.sign(a - b) * hi / np.sqrt(293.0) * flow

    def command(self, u):
        half = np.array([0.5, -0.5])[:, None] * u
        target = np.clip((self.feq + half) / self.S + self.pa, self.pa, self.ps)
        self.play = np.minimum(np.maximum(self.play, target - 1500.0), target + 1500.0)

    def advance(self, x, v, h):
        """One explicit Euler step in four parts for the fast valve states."""
        V = np.array([2e-6 + self.S[0] * (0.15 + x), 2e-6 + self.S[1] * (0.15 - x)])
        dV = np.array([self.S[0] * v, -self.S[1] * v])
        sub = 2
        hh = h / sub
        RT = 287.0 * 293.0
        delayed = self.line.pop(0)
        first = None
        for _ in range(sub):
            e = self.c - self.pv
            w = np.clip(8e-6 * e + self.q, -1, 1)
            s = self.s
            o = np.where(s > 0.02, np.minimum(1, s - 0.02), np.where(s < -0.02, np.maximum(-1, s + 0.02), 0.0))
            mv = np.where(o >= 0, 0.8 * 3e-6 * o * self.psi(self.ps, self.pv), -0.8 * 3e-6 * np.abs(o) * self.psi(self.pv, self.pa))
            mt = 0.8 * 1.4e-6 * self.psi(self.pv, self.p)
            first = mt if first is None else first
            a = np.where(delayed > 0, 1.4, 1.0)
            leak = 0.010e-6 * self.psi(self.p, self.p[::-1])
            dq = np.where(np.abs(self.q + 1e-4 * e * 1e-3) >= 0.3, 0.0, 1e-4 * e)
            self.c = self.c + hh * (self.play - self.c) / 0.0015
            self.q = self.q + hh * dq
            ws = 2 * np.pi * 70
            self.w = self.w + hh * (ws**2 * (w - self.s) - 2 * 0.7 * ws * self.w)
            self.s = self.s + hh * self.w
            self.pv = self.pv + hh * 1.2 * RT * (mv - mt) / 9e-6
            self.p = self.p + hh * (RT * (a * delayed - leak) - 1.2 * self.p * dV) / V
        self.line.append(first)

    def f_hat(self):
        return self.S[0] * (self.pv[0] - self.pa) - self.S[1] * (self.pv[1] - self.pa)

    def force(self):
        return 0.955 * (self.S[0] * (self.p[0] - self.pa) - self.S[1] * (self.p[1] - self.pa))


ARX_FP = ([[-1.013602, 0.027052], [-0.032284, -0.95853]], [0.225645, -0.162456], [-0.213883, 0.168954])


def write(folder, name, data, sensors, signals, arx, truth):
    target = folder / name
    target.mkdir(parents=True, exist_ok=True)
    a, b0, b1 = arx
    text = [f'id = "{name}"', 'kind = "cartpole"', "sample_rate_hz = 1000", "[model.actuator]", "sample_time = 0.001",
            f"A1 = {np.asarray(a).tolist()}", f"B0 = {np.asarray(b0).tolist()}", f"B1 = {np.asarray(b1).tolist()}",
            "[model.piston_friction]", "c1 = 1.5145", "c2 = 40.8926", "c3 = 0.0", "c4 = 49.2734", "c5 = 0.0",
            "[model.cart_friction]", "c1 = 5.7910", "c2 = 63.7045", "c3 = 0.0064", "c4 = 0.0", "c5 = -2.3170",
            "[model.cart_pole]", "m_c = 0.399", "m_p = 0.1", "l = 0.2", "g = 9.81", "b_p = 0.0006",
            "tip_distance = 0.25", "stroke = 0.300"]
    for signal in ["u", *signals]:
        unit = {"x": "m", "theta": "rad"}.get(signal, "N")
        text += [f"[sensors.{signal}]", f'unit = "{unit}"', f"noise_rms = {sensors[signal]}"]
    for i in range(10):
        role = "estimation" if i < 6 else "validation"
        text += ["[[files]]", f'name = "trial_{i + 1:02d}.csv"', f'role = "{role}"', 'experiment = "coupled"',
                 f'group = "command_{"abcde"[i // 2]}"']
        columns = [np.arange(N) * TS] + [data[s][:, i] for s in ["u", *signals]]
        formats = ["%.3f"] + [{"u": "%.3f", "x": "%.5f", "theta": "%.5f"}.get(s, "%.2f") for s in ["u", *signals]]
        np.savetxt(target / f"trial_{i + 1:02d}.csv", np.array(columns).T, fmt=formats, delimiter=",",
                   header=",".join(["time", "u", *signals]), comments="")
    (target / "case.toml").write_text("\n".join(text) + "\n")
    lines = [f'class = "{truth["class"]}"', f'verdict = "{truth["verdict"]}"']
    for effect in truth["effects"]:
        lines += ["[[effects]]", f'id = "{effect["id"]}"', f'channel = "{channel(effect["id"])}"']
        if effect.get("signal"):
            lines.append(f'signal = "{effect["signal"]}"')
        lines += ["[effects.params]"] + [f"{k} = {v!r}" for k, v in effect["params"].items()]
    if truth.get("channel"):
        lines += ["[unexplained]", f'channel = "{truth["channel"]}"']
    (target / "truth.toml").write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n")


def specification(rng):
    """Names and effects of the cases."""
    cases = []
    add = lambda name, cls, effects, **more: cases.append(dict(name=name, cls=cls, effects=effects, **more))
    for effect, ranges in EFFECTS.items():
        if effect.startswith("sensor."):
            for signal in ("F_hat", "F_p", "x", "theta"):
                if (effect, signal) == ("sensor.offset", "x"):
                    continue
                params = draw(rng, ranges)
                if effect == "sensor.offset":
                    params = {"value": params["value"] * OFFSET_UNIT[signal]}
                add(f"s_{effect}_{signal}", "single", [(effect, params, signal)])
        else:
            add(f"s_{effect}", "single", [(effect, draw(rng, ranges), None)])
    for i in range(4):
        add(f"c_none_{i}", "control", [])
    names = [e for e in EFFECTS if not e.startswith("sensor.")]
    for i in range(10):
        while True:
            pair = rng.choice(names, 2, replace=False)
            if channel(pair[0]) != channel(pair[1]):
                break
        add(f"d_{pair[0]}_{pair[1]}", "double", [(e, draw(rng, EFFECTS[e]), None) for e in pair])
    for effect, (where, ranges) in OUTSIDE.items():
        add(f"o_{effect}", "outside", [(effect, draw(rng, ranges), None)], channel=where)
    for effect in ("act.backpressure", "cf.viscous", "pf.coulomb", "cart.mass", "pole.payload", "act.delay", "cf.presliding", "act.hysteresis"):
        add(f"f_{effect}", "few sensors", [(effect, draw(rng, EFFECTS[effect]), None)], few=True)
    for effect in ("pole.quaddrag", "cf.coulomb", "cart.mass", "pf.viscous", "act.deadband", "cart.spring", "pole.length", "cf.stribeck"):
        add(f"p_{effect}", "parameters off", [(effect, draw(rng, EFFECTS[effect]), None)], off=True)
    for effect in ("pole.coulomb", "cart.spring", "cf.stribeck", "cart.endstop", "pole.length", "cf.viscous"):
        add(f"b_{effect}", "first principles", [(effect, draw(rng, EFFECTS[effect]), None)], fp=True)
    return cases


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    everything = specification(rng)
    for case in everything:
        case["feed"] = commands(rng)
        case["noise"] = dict(u=0.0, F_hat=0.3, F_p=round(rng.uniform(0.24, 0.47), 2), x=1e-4, theta=0.00044)
        case["plant"] = {k: v * (1 + (rng.normal() * 0.01 if case.get("off") else 0.0)) for k, v in DECLARED.items()}
        case["x0"], case["th0"] = rng.normal(0, 0.003, 10), rng.normal(0, 0.015, 10)
        case["noise_x"] = rng.normal(0, 1e-4, (N, 10))
        case["seed"] = int(rng.integers(1 << 30))
    for fp in (False, True):
        cases = [c for c in everything if bool(c.get("fp")) == fp and args.only in c["name"]]
        if not cases:
            continue
        lanes = [{e: p for e, p, s in c["effects"] if s is None} for c in cases for _ in range(10)]
        ff = np.concatenate([np.repeat(c["feed"], 2, axis=0) for c in cases])
        plant = {k: np.repeat([c["plant"][k] for c in cases], 10) for k in DECLARED}
        out = simulate(lanes, ff, np.concatenate([c["x0"] for c in cases]), np.concatenate([c["th0"] for c in cases]), plant,
                       np.concatenate([c["noise_x"] for c in cases], axis=1), rng, fp)
        for i, c in enumerate(cases):
            own = np.random.default_rng(c["seed"])
            data = {k: v[:, 10 * i:10 * i + 10] for k, v in out.items()}
            for effect, params, signal in c["effects"]:
                if signal is None:
                    continue
                y = data[signal]
                if effect == "sensor.offset":
                    y = y + params["value"]
                elif effect == "sensor.gain":
                    y = y * (1 + params["gain"])
                else:
                    t = np.arange(N) * TS
                    y = np.array([np.interp(t - params["delay"], t, y[:, j]) for j in range(10)]).T
                data[signal] = y
            for signal in ("F_hat", "F_p"):
                data[signal] = data[signal] + own.normal(0, c["noise"][signal], (N, 10))
            sensed_x = any(s == "x" for _, _, s in c["effects"])
            data["x"] = data["x"] + (own.normal(0, 1e-4, (N, 10)) if sensed_x else c["noise_x"])
            step = 2 * np.pi / 4096
            data["theta"] = np.round(data["theta"] / step) * step
            signals = ["x", "theta"] if c.get("few") else ["F_hat", "F_p", "x", "theta"]
            verdict = {"control": "none", "outside": "unexplained"}.get(c["cls"], "effect")
            truth = {"class": c["cls"], "verdict": verdict, "channel": c.get("channel"),
                     "effects": [] if c["cls"] == "outside" else [dict(id=e, params=p, signal=s) for e, p, s in c["effects"]]}
            write(args.folder, c["name"], data, c["noise"], signals, ARX_FP if fp else (A1, B0, B1), truth)


if __name__ == "__main__":
    main()
