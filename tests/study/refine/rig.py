"""The rig in NumPy, all trials of all cases side by side, with undeclared effects: coupled runs, rod fixed, sweeps.

Independent of the library: the equations are typed here from the description of the effects; explicit Runge-Kutta of
order 4 with 0.25 ms (the library: 0.5 ms), and another layout (rates of separate arrays instead of a state record).
Nothing of the library's effect code is used.
"""
import numpy as np

from messy import Mess

TS = 1e-3
N = 4000
SUB = 4
A1 = np.array([[-1.0144, 0.0216], [-0.0527, -0.9537]])
B0 = np.array([0.6619, 0.0764])
B1 = np.array([-0.6557, -0.0847])
POLE = np.linalg.eigvals(-A1)[0]
# Turns the pair of conjugate poles: A1 - a I - b TURN has its poles moved by a +- b i.
TURN = (-A1 - POLE.real * np.eye(2)) / POLE.imag
DECLARED = dict(pc1=1.5145, pc2=40.8926, pc4=49.2734, cc1=5.7910, cc2=63.7045, cc3=0.0064, cc5=-2.3170,
                m_c=0.399, m_p=0.1, l=0.2, b_p=0.0006, act=1.0, pole_re=0.0, pole_im=0.0)
G, TIP = 9.81, 0.25

class Lanes:
    """Parameters of all trials side by side: p["cart.spring.stiffness"] has one entry per lane."""

    def __init__(self, effects):
        self.effects = effects
        self.count = len(effects)

    def get(self, effect, name, neutral=0.0):
        return np.array([e.get(effect, {}).get(name, neutral) for e in self.effects])

    def has(self, effect):
        return np.array([effect in e for e in self.effects])


def simulate(effects, ff, x0, th0, plant, noise_x, cylinder=None, centring=55.0, restart=None, window=500,
             fixed=False):
    """All trials at once. effects: list of {effect: parameters}; ff [lanes, N]; plant: dict of arrays [lanes].

    `cylinder`: dimensions of a cylinder from first principles [lanes], as in `Pneumatic`; none: the declared actuator.
    `fixed`: the rod does not move. `restart`: states [N, 6, lanes] that the mechanics are set to every `window` samples, the actuator running on.
    """
    p, n = Lanes(effects), len(effects)
    mess = Mess(p)
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
    vq, fade, drift = p.get("out.cartdrag", "coef"), p.get("out.fade", "rate"), p.get("out.drift", "coef")
    da, dn, p3 = p.get("out.detent", "torque"), p.get("out.detent", "teeth", 1.0), p.get("out.cable", "k3")
    ra, rp = p.get("out.ripple", "amp"), p.get("out.ripple", "period", 1.0)
    wd, wf = p.get("out.wobble", "delay"), p.get("out.wobble", "f", 1.0)

    def piston(x, v, z, ph, t):
        s = np.tanh(q["pc2"] * v)
        f = q["pc1"] * np.where(ppre, z / pdisp, s) + pv * v
        f = f + pc * s + (ps * np.exp(-(v / pvs) ** 2) * s if ps.any() else 0.0) + pp * np.abs(ph) * s + po + np.where(v > 0, paf * s + pac * v, 0.0)
        f = f + mess("piston", x, v, t)
        if drift.any():
            f = f + drift * (1 - np.exp(-t / 1.5)) * v
        return f + qa * np.exp(-((x - qx) / qw) ** 2) * np.tanh(30 * v) if qa.any() else f

    def cart(x, v, z, t):
        w = v - q["cc3"]
        s = np.tanh(q["cc2"] * w)
        f = q["cc1"] * np.where(cpre, z / cdisp, s) + q["cc5"] + cv * v + cc * s + (cs * np.exp(-(w / cvs) ** 2) * s if cs.any() else 0.0) + co
        f = f + np.where(v > 0, caf * s + cac * v, 0.0) + cpos * x * s + mess("cart", x, v, t)
        if vq.any() or fade.any():
            f = f + vq * np.abs(v) * v + fade * t * s
        return f + ta * np.exp(-((np.abs(v) - tv) / tw) ** 2) * np.sign(v) if ta.any() else f

    def rates(x, v, th, om, zp, zc, force, ph, t_):
        f = force - piston(x, v, zp, ph, t_) - cart(x, v, zc, t_) - k * (x - rest) - mass * G * np.sin(tilt)
        f = f - np.where(x > sp, np.maximum(0.0, sk * (x - sp) + sd * v), 0.0) - ca * np.sin(2 * np.pi * x / cper + cph)
        f = f - (ba * np.exp(-((x - bx) / bw) ** 2) if ba.any() else 0.0) - k3 * x**3 + mpl * om**2 * np.sin(th)
        t = -bp * om - mpl * G * np.sin(th + tilt) - tq * np.tanh(om / 0.05) - qd * np.abs(om) * om - mess("pole", th, om, t_)
        if ma.any() or da.any() or p3.any():
            t = t - ma * np.exp(-((th - mt) / mw) ** 2) - da * np.sin(dn * th) - p3 * th**3
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
    U = np.zeros((ff.shape[1] + 64, n))
    out = {name: np.zeros((ff.shape[1], n)) for name in ("u", "F_hat", "F_p", "x", "theta")}
    out["states"] = np.zeros((ff.shape[1], 6, n))
    fp = None if cylinder is None else Pneumatic(n, cylinder)
    lanes = np.arange(n)
    for i in range(ff.shape[1]):
        if restart is not None and i % window == 0:
            s = list(restart[i])
        xm = s[0] + noise_x[i]
        u = np.round(ff[:, i] - centring * xm, 3)
        U[i + 64] = u
        back_samples = (delay + wd * (1 + np.sin(2 * np.pi * wf * i * TS)) / 2) / TS
        whole = np.floor(back_samples).astype(int)
        part = back_samples - whole
        ue = (1 - part) * U[i + 64 - whole, lanes] + part * U[i + 63 - whole, lanes]
        play = np.minimum(np.maximum(play, ue - hys), ue + hys)
        ue = play
        ue = ue - np.clip(ue, -dead, dead)
        ue = np.clip(ue, -lim, lim) * (1 + gain) * (1 + posgain * s[0]) * (1 - depth * (1 - np.exp(-i * TS / tau)))
        ue = ue + mess("command", ue, i * TS)
        if ra.any():
            ue = ue + ra * np.sin(2 * np.pi * ue / rp)
        if mode.any():
            now = m1.copy()
            h = TS / 20
            for _ in range(20):
                a1, b1 = m2, mw2**2 * (ue - m1) - 2 * mz * mw2 * m2
                a2, b2 = m2 + h / 2 * b1, mw2**2 * (ue - m1 - h / 2 * a1) - 2 * mz * mw2 * (m2 + h / 2 * b1)
                m1, m2 = m1 + h * a2, m2 + h * b2
            ue = np.where(mode, now, ue)
        if fp is None:
            y = -(A1 @ y) + q["pole_re"] * y + q["pole_im"] * (TURN @ y) + np.outer(B0, ue * q["act"]) + np.outer(B1, ub * q["act"])
            ub = ue
            fh, fa = y[0] - back * s[1] + la * np.sin(2 * np.pi * lf * i * TS), y[1] - back * s[1] + la * np.sin(2 * np.pi * lf * i * TS)
            out["F_hat"][i], out["F_p"][i] = fh, fa - piston(s[0], s[1], s[4], fh, i * TS)
            steps, h = SUB, TS / SUB
        else:
            fp.command(ue)
            steps, h = 10, TS / 10
            fh = fp.f_hat() - back * s[1]
            fa = fp.force() - back * s[1]
            out["F_hat"][i], out["F_p"][i] = fh, fa - piston(s[0], s[1], s[4], fh, i * TS)
        out["u"][i], out["x"][i], out["theta"][i] = u, s[0], s[2]
        out["states"][i] = s
        if fixed:
            out["F_p"][i] = fa
            continue
        for _ in range(steps):
            if fp is not None:
                # The cylinder steps first, then the mechanics under its new force.
                fp.advance(s[0], s[1], h)
                fa = fp.force() - back * s[1]
            k1 = rates(*s, fa, fh, i * TS)
            k2 = rates(*[a + h / 2 * b for a, b in zip(s, k1)], fa, fh, i * TS)
            k3_ = rates(*[a + h / 2 * b for a, b in zip(s, k2)], fa, fh, i * TS)
            k4 = rates(*[a + h * b for a, b in zip(s, k3_)], fa, fh, i * TS)
            s = [a + h / 6 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(s, k1, k2, k3_, k4)]
    return out


# Dimensions of the cylinder of the rig, SI units, as in the FMU pneumatic-cylinder.
CYLINDER = {"bore": 0.020, "rod": 0.008, "stroke": 0.300, "dead": 2e-6, "psup": 0.5e6, "Avmax": 3e-6, "Kp": 8e-6, "vhys": 1500.0,
            "Vt": 9e-6, "At": 1.4e-6, "tdelay": 0.003, "eta": 0.955}


class Pneumatic:
    """Two chambers behind pressure valves and tubes (the first-principles actuator of the rig description).

    `dimensions`: arrays [n] by the names of CYLINDER; what is left out is as there.
    """

    def __init__(self, n, dimensions=None):
        k = self.k = {name: np.asarray((dimensions or {}).get(name, value)) * np.ones(n) for name, value in CYLINDER.items()}
        self.S = np.pi / 4 * np.array([k["bore"]**2, k["bore"]**2 - k["rod"]**2])
        self.pa, self.ps = 101325.0, k["psup"] + 101325.0
        self.feq = 0.5 * k["psup"] * self.S.sum(0) / 2
        self.p = self.feq / self.S + self.pa
        self.pv, self.c, self.play = self.p.copy(), self.p.copy(), self.p.copy()
        self.q, self.s, self.w = np.zeros((2, n)), np.zeros((2, n)), np.zeros((2, n))
        # Flows that entered the tubes, in steps of 0.1 ms: what enters at the beginning of this step has left when the delay is over.
        self.steps = np.round(k["tdelay"] * 1e4).astype(int) - 1
        self.line, self.at, self.lanes = np.zeros((self.steps.max() + 1, 2, n)), 0, np.arange(n)

    @staticmethod
    def psi(a, b):
        hi, lo = np.maximum(a, b), np.minimum(a, b)
        r = lo / hi
        k = 1.4
        f = lambda r: 0.156174 * r ** (1 / k) * np.sqrt(np.maximum(0.0, 1 - r ** ((k - 1) / k)))
        flow = np.where(r <= 0.528, 0.040418, np.where(r < 0.995, f(r), f(0.995) * (1 - r) / 0.005))
        return np.sign(a - b) * hi / np.sqrt(293.0) * flow

    def command(self, u):
        half, play = np.array([0.5, -0.5])[:, None] * u, self.k["vhys"]
        target = np.clip((self.feq + half) / self.S + self.pa, self.pa, self.ps)
        self.play = np.minimum(np.maximum(self.play, target - play), target + play)

    def rates(self, y, delayed, x, v):
        """Time derivatives of filtered command, integrator, spool, its rate, port and chamber pressure; flow into the tubes."""
        c, q, s, w, pv, p = y
        k = self.k
        V = np.array([k["dead"] + self.S[0] * (k["stroke"] / 2 + x), k["dead"] + self.S[1] * (k["stroke"] / 2 - x)])
        dV = np.array([self.S[0] * v, -self.S[1] * v])
        RT, ws = 287.0 * 293.0, 2 * np.pi * 70
        e = c - pv
        o = np.where(s > 0.02, np.minimum(1, s - 0.02), np.where(s < -0.02, np.maximum(-1, s + 0.02), 0.0))
        full = 0.8 * k["Avmax"]
        mv = np.where(o >= 0, full * o * self.psi(self.ps, pv), -full * np.abs(o) * self.psi(pv, self.pa))
        mt = 0.8 * k["At"] * self.psi(pv, p)
        a = np.where(delayed > 0, 1.4, 1.0)
        leak = 0.010e-6 * self.psi(p, p[::-1])
        return np.array([
            (self.play - c) / 0.0015,
            np.where(np.abs(q + 1e-4 * e * 1e-3) >= 0.3, 0.0, 1e-4 * e),
            w,
            ws**2 * (np.clip(k["Kp"] * e + q, -1, 1) - s) - 2 * 0.7 * ws * w,
            1.2 * RT * (mv - mt) / k["Vt"],
            (RT * (a * delayed - leak) - 1.2 * p * dV) / V,
        ]), mt

    def advance(self, x, v, h):
        """One Runge-Kutta step of order 4; motion and the flow out of the tubes are held over it."""
        size = len(self.line)
        # The line is a ring: what stands `steps` places back leaves, and what enters overwrites the oldest.
        delayed = self.line[(self.at - self.steps) % size, :, self.lanes].T
        y = np.array([self.c, self.q, self.s, self.w, self.pv, self.p])
        k1, first = self.rates(y, delayed, x, v)
        k2, _ = self.rates(y + h / 2 * k1, delayed, x, v)
        k3, _ = self.rates(y + h / 2 * k2, delayed, x, v)
        k4, _ = self.rates(y + h * k3, delayed, x, v)
        self.c, self.q, self.s, self.w, self.pv, self.p = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.line[self.at % size] = first
        self.at += 1

    def f_hat(self):
        return self.S[0] * (self.pv[0] - self.pa) - self.S[1] * (self.pv[1] - self.pa)

    def force(self):
        return self.k["eta"] * (self.S[0] * (self.p[0] - self.pa) - self.S[1] * (self.p[1] - self.pa))


def identified(dimensions, u):
    """A1, B0, B1 by least squares from the forces of a cylinder whose rod is fixed, under the commands `u` [records, N]."""
    cylinder = Pneumatic(len(u), {name: np.full(len(u), value) for name, value in dimensions.items()})
    y = np.zeros((u.shape[1], 2, len(u)))
    for i in range(u.shape[1]):
        cylinder.command(u[:, i])
        y[i] = cylinder.f_hat(), cylinder.force()
        for _ in range(10):
            cylinder.advance(0.0, 0.0, TS / 10)
    now, before = y[1:], y[:-1]
    columns = np.array([before[:, 0].ravel(), before[:, 1].ravel(), u.T[1:].ravel(), u.T[:-1].ravel()]).T
    found = np.linalg.lstsq(columns, np.array([now[:, 0].ravel(), now[:, 1].ravel()]).T, rcond=None)[0].T
    return np.round(-found[:, :2], 6), np.round(found[:, 2], 6), np.round(found[:, 3], 6)


def sweep(effects, plant, cart, draw, n=7000):
    """One friction sweep: the piston or the cart alone follows a sum of sines; x, v and the load cell.

    `draw`: thirteen numbers in 0..1 for amplitude, frequencies, phases.
    """
    fine = 4
    t = np.arange(n * fine) * TS / fine
    f = np.array([1, 2, 3, 5, 8, 13]) * (0.14 + 0.06 * draw[0]) * 1.3
    amp, phase = 0.2 + draw[1:7], 2 * np.pi * draw[7:13]
    v = (amp[:, None] * np.sin(2 * np.pi * f[:, None] * t + phase[:, None])).sum(0)
    a = (amp[:, None] * 2 * np.pi * f[:, None] * np.cos(2 * np.pi * f[:, None] * t + phase[:, None])).sum(0)
    scale = (0.08 if draw[0] < 0.35 else 0.5) / np.abs(v).max()
    v, a = scale * v, scale * a
    x = -(scale * amp[:, None] / (2 * np.pi * f[:, None]) * (np.cos(2 * np.pi * f[:, None] * t + phase[:, None]) - np.cos(phase[:, None]))).sum(0)
    get = lambda e, name, neutral=0.0: effects.get(e, {}).get(name, neutral)
    own, port = ("cf", "cart") if cart else ("pf", "piston")
    c1, c2, c3 = (plant["cc1"], plant["cc2"], plant["cc3"]) if cart else (plant["pc1"], plant["pc2"], 0.0)
    w = v - c3
    s = np.tanh(c2 * w)
    main = s
    if f"{own}.presliding" in effects:
        z, main, disp = 0.0, np.zeros_like(s), get(f"{own}.presliding", "disp")
        for k in range(len(t)):
            main[k] = z / disp
            # Exact for the speed of this fine step.
            z = np.sign(w[k]) * disp + (z - np.sign(w[k]) * disp) * np.exp(-np.abs(w[k]) * TS / fine / disp)
    force = c1 * main + get(f"{own}.viscous", "coef") * v + get(f"{own}.coulomb", "force") * s + get(f"{own}.offset", "value")
    force = force + get(f"{own}.stribeck", "force") * np.exp(-(w / get(f"{own}.stribeck", "vs", 1.0)) ** 2) * s
    force = force + np.where(v > 0, get(f"{own}.asymmetry", "force") * s + get(f"{own}.asymmetry", "coef") * v, 0.0)
    force = force + Mess(Lanes([effects]))(port, x, v, t)
    if cart:
        force = force + plant["cc5"] + get("cf.poscoulomb", "slope") * x * s + (plant["m_c"] + get("cart.mass", "mass")) * a
    else:
        force = force + plant["pc4"] * v
    return {k: y[::fine] for k, y in (("x", x), ("v", v), ("F_p", force))}
