"""Effects of the study: ranges of their parameters, their channels."""
import numpy as np
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
    "out.cartdrag": ("cart_friction", dict(coef=(10.0, 60.0))),
    "out.fade": ("cart_friction", dict(rate=(0.3, 1.0))),
    "out.drift": ("piston_friction", dict(coef=("+-", 5.0, 20.0))),
    "out.detent": ("pole", dict(torque=(0.003, 0.01), teeth=(9.0, 20.0))),
    "out.cable": ("pole", dict(k3=(0.02, 0.2))),
    "out.ripple": ("actuator", dict(amp=(0.5, 2.0), period=(6.0, 14.0))),
    "out.wobble": ("actuator", dict(delay=(0.003, 0.01), f=(0.4, 1.5))),
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

# What grows with the strength of an effect (where it is not the first parameter), and what falls.
SCALED = {"pf.asymmetry": ("force", "coef"), "cf.asymmetry": ("force", "coef"), "cart.endstop": ("stiffness", "damping")}
INVERSE = ("act.saturation", "act.mode")


def scaled(effect, params, factor):
    """The parameters of an effect made stronger by about `factor`."""
    names = SCALED.get(effect, (next(iter(params)),))
    limits = {"delay": 0.03, "disp": 0.02, "depth": 0.6, "limit": 28.0, "freq": 150.0}
    grown = {n: params[n] / factor if effect in INVERSE else params[n] * factor for n in names}
    return {**params, **{n: min(v, limits.get(n, v)) for n, v in grown.items()}}
