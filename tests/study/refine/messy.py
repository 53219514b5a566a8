"""What makes a rig messy: declared values that are off, and small forces and torques of forms that are in no list.

A small term is an effect named `mess.PORT.FORM`; its amplitude is scaled by make_messy.py.
"""
import numpy as np

# One standard deviation of a declared value, relative, drawn from this range.
OFF = {"m_c": (0.005, 0.005), "m_p": (0.005, 0.005), "l": (0.002, 0.002), "pc1": (0.01, 0.03), "cc1": (0.01, 0.03),
       "cc5": (0.01, 0.03), "pc4": (0.01, 0.03), "b_p": (0.01, 0.03), "pc2": (0.1, 0.1), "cc2": (0.1, 0.1), "act": (0.003, 0.003)}
POLES = (3e-5, 8e-5)


def power(v, exponent):
    return np.sign(v) * np.abs(v) ** exponent


# Port and form: typical amplitude, ranges of the parameters, shape over the variables of the port.
FORMS = {
    "command.kink": (0.005, dict(at=(5.0, 20.0)), lambda q, u, t: np.maximum(0.0, u - q["at"])),
    "command.cubic": (0.07, dict(scale=(25.0, 40.0)), lambda q, u, t: (u / q["scale"]) ** 3),
    "command.bump": (0.1, dict(at=(-15.0, 15.0), width=(4.0, 10.0)), lambda q, u, t: np.exp(-((u - q["at"]) / q["width"]) ** 2)),
    "command.wander": (0.0025, dict(f=(0.15, 0.6), phase=(-3.0, 3.0)), lambda q, u, t: u * np.sin(2 * np.pi * q["f"] * t + q["phase"])),
    "piston.bump": (0.4, dict(at=(-0.03, 0.03), width=(0.006, 0.02)),
                    lambda q, x, v, t: np.exp(-((x - q["at"]) / q["width"]) ** 2) * np.tanh(20 * v)),
    "piston.power": (0.2, dict(exponent=(0.3, 0.7)), lambda q, x, v, t: power(v, q["exponent"])),
    "piston.product": (13.0, dict(at=(-0.02, 0.02)), lambda q, x, v, t: (x - q["at"]) * v),
    "piston.wander": (0.15, dict(f=(0.15, 0.6), phase=(-3.0, 3.0)),
                      lambda q, x, v, t: np.sin(2 * np.pi * q["f"] * t + q["phase"]) * np.tanh(15 * v)),
    "cart.bump": (0.12, dict(at=(-0.03, 0.03), width=(0.006, 0.02)), lambda q, x, v, t: np.exp(-((x - q["at"]) / q["width"]) ** 2)),
    "cart.power": (0.1, dict(exponent=(0.3, 0.7)), lambda q, x, v, t: power(v, q["exponent"])),
    "cart.soft": (0.4, dict(exponent=(0.5, 0.8)), lambda q, x, v, t: power(x, q["exponent"])),
    "cart.product": (70.0, dict(at=(-0.02, 0.02)), lambda q, x, v, t: (x - q["at"]) * np.abs(x) * v),
    "cart.teeth": (0.1, dict(period=(0.01, 0.04), phase=(-3.0, 3.0)),
                   lambda q, x, v, t: np.sin(2 * np.pi * x / q["period"] + q["phase"]) ** 3),
    "cart.wander": (0.08, dict(f=(0.15, 0.6), phase=(-3.0, 3.0)), lambda q, x, v, t: np.sin(2 * np.pi * q["f"] * t + q["phase"])),
    "pole.bump": (0.0004, dict(at=(-0.5, 0.5), width=(0.1, 0.3)), lambda q, x, v, t: np.exp(-((x - q["at"]) / q["width"]) ** 2)),
    "pole.power": (0.0003, dict(exponent=(0.3, 0.7)), lambda q, x, v, t: power(v, q["exponent"])),
    "pole.product": (0.003, dict(at=(-0.2, 0.2)), lambda q, x, v, t: (x - q["at"]) * v),
    "pole.wander": (0.0003, dict(f=(0.15, 0.6), phase=(-3.0, 3.0)), lambda q, x, v, t: v * np.sin(2 * np.pi * q["f"] * t + q["phase"])),
    "pole.teeth": (0.0006, dict(count=(4.0, 9.0), phase=(-3.0, 3.0)), lambda q, x, v, t: np.sin(q["count"] * x + q["phase"]) ** 3),
}
# How many small terms act at each port.
PORTS = {"cartpole": dict(command=1, piston=1, cart=2, pole=1), "actuator": dict(command=1), "friction": dict(piston=2, cart=2)}


class Mess:
    """The small terms of all lanes, by port: `mess("cart", x, v, t)` is their sum, 0 without any."""

    def __init__(self, lanes):
        self.terms = {}
        for name, (_, ranges, shape) in FORMS.items():
            amp = lanes.get(f"mess.{name}", "amp")
            if amp.any():
                values = {k: lanes.get(f"mess.{name}", k, 1.0) for k in ranges}
                self.terms.setdefault(name.split(".")[0], []).append((amp, values, shape))

    def __call__(self, port, *variables):
        return sum(amp * shape(values, *variables) for amp, values, shape in self.terms.get(port, []))


def small_terms(rng, kind):
    """Terms of a case at different ports, with typical amplitudes of either sign."""
    found = []
    for port, count in PORTS[kind].items():
        names = [name for name in FORMS if name.startswith(port + ".")]
        for name in rng.choice(names, count, replace=False):
            typical, ranges, _ = FORMS[name]
            found.append((f"mess.{name}", {"amp": typical * rng.choice([-1.0, 1.0]), **{k: rng.uniform(*r) for k, r in ranges.items()}}, None))
    return found


def off(rng, declared):
    """The true values behind the declared ones."""
    plant = {k: v * (1 + rng.normal() * rng.uniform(*OFF[k]) if k in OFF else 1.0) for k, v in declared.items()}
    size, angle = rng.uniform(*POLES), rng.uniform(-np.pi, np.pi)
    return {**plant, "pole_re": size * np.cos(angle), "pole_im": size * np.sin(angle)}
