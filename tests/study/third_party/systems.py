"""The six third-party systems: declared values with units and tolerances, sensors, and where a study looks for effects.

Order of states, inputs and parameters is that of truth.c. Tolerances are one standard deviation, relative.
"""
import dataclasses

import numpy as np


@dataclasses.dataclass
class Port:
    """A place where effects act. `index`: its number in truth.c; `channels`: of the attachment in study.toml; `vt`:
    speed over which friction changes its sign."""
    index: int
    channels: tuple
    velocity: str = ""
    position: str = ""
    viscous: str = ""
    coulomb: str = ""
    vt: float = 0.0


@dataclasses.dataclass
class System:
    """`states`: name -> (unit, nominal, state whose derivative it is); `inputs`: name -> (unit, amplitude that the
    records use; 0: not fed); `parameters`: name -> (value, unit, tolerance); `measured`: state -> (rms of the sensor
    noise, quantum)."""
    name: str
    step: float
    duration: float
    inner: int
    states: dict
    inputs: dict
    parameters: dict
    measured: dict
    ports: dict
    excite: object
    start: dict = dataclasses.field(default_factory=dict)
    gain: float = 0.0
    # Steps that a typical delay or lag takes.
    pace: float = 3.0
    # Whether velocities stand for the derivatives of positions in the model description, or `der(...)` does.
    short: bool = True
    # States that are local variables of the FMU.
    hidden: tuple = ()

    @property
    def commands(self):
        return [name for name, (_, amplitude) in self.inputs.items() if amplitude]

    def declared(self):
        return {name: value for name, (value, _, _) in self.parameters.items()}


def multisine(rng, t, low, high, count=7):
    """Sum of sines with random frequencies and phases, largest value 1, that starts at 0."""
    f, phase = np.exp(rng.uniform(np.log(low), np.log(high), count)), rng.uniform(0, 2 * np.pi, count)
    y = (np.sin(2 * np.pi * f[:, None] * t + phase[:, None]) / np.sqrt(f[:, None])).sum(0)
    return y / np.abs(y).max() * np.minimum(t / (0.05 * t[-1]), 1.0)


def steps(rng, t, shortest, longest):
    """Levels within -1 ... 1 that change at random times; the first is 0."""
    y, at = np.zeros(len(t)), rng.uniform(0.1, 0.5) * shortest
    while at < t[-1]:
        y[t >= at] = rng.uniform(-1, 1)
        at += rng.uniform(shortest, longest)
    return y


def chirp(rng, t, low, high):
    """Sine whose frequency rises from `low` to `high`."""
    rate = (high - low) / t[-1]
    return np.sin(2 * np.pi * (low * t + rate * t * t / 2)) * rng.choice([-1, 1])


def mixed(low, high, shortest, longest, soft=0.6):
    """Records in turn: multisine, steps with a small multisine, chirp with slow steps."""
    def excite(rng, k, t):
        if k % 3 == 0:
            return multisine(rng, t, low, high)
        if k % 3 == 1:
            return soft * steps(rng, t, shortest, longest) + (1 - soft) * multisine(rng, t, low, high)
        return 0.5 * chirp(rng, t, low, high) + 0.5 * steps(rng, t, 1.5 * shortest, 1.5 * longest)
    return excite


RAD, SPEED = "rad", "rad/s"

SYSTEMS = {s.name: s for s in [
    System(
        "servo", 0.002, 8.0, 5,
        states={"phi_m": (RAD, 1.0, ""), "w_m": (SPEED, 10.0, "phi_m"), "phi_l": (RAD, 1.0, ""), "w_l": (SPEED, 10.0, "phi_l")},
        inputs={"tau_m": ("N.m", 0.5), "tau_l": ("N.m", 0.0)},
        parameters={"J_m": (2e-3, "kg.m2", 0.01), "J_l": (6e-3, "kg.m2", 0.01), "k": (8.0, "N.m/rad", 0.01), "d": (0.01, "N.m.s/rad", 0.03),
                    "b_m": (0.012, "N.m.s/rad", 0.03), "b_l": (0.008, "N.m.s/rad", 0.03), "tau_c": (0.03, "N.m", 0.03), "w_c": (0.5, SPEED, 0.0)},
        measured={"w_m": (0.02, 0.005), "w_l": (0.02, 0.005)},
        ports={"tau_m": Port(0, ("actuator", "piston_friction"), "w_m", "phi_m", "b_m", "tau_c", 0.5),
               "tau_l": Port(1, ("cart_friction", "cart"), "w_l", "phi_l", "b_l", "", 0.05)},
        excite=mixed(0.3, 6.0, 0.4, 1.2)),
    System(
        "arm", 0.004, 12.0, 8,
        states={"q_1": (RAD, 1.0, ""), "q_2": (RAD, 1.0, ""), "w_1": (SPEED, 1.0, "q_1"), "w_2": (SPEED, 1.0, "q_2")},
        inputs={"tau_1": ("N.m", 4.0), "tau_2": ("N.m", 1.4)},
        parameters={"m_1": (2.0, "kg", 0.01), "m_2": (1.2, "kg", 0.01), "l_1": (0.4, "m", 0.003), "a_1": (0.2, "m", 0.005), "a_2": (0.18, "m", 0.005),
                    "I_1": (0.03, "kg.m2", 0.01), "I_2": (0.014, "kg.m2", 0.01), "b_1": (0.4, "N.m.s/rad", 0.03), "b_2": (0.12, "N.m.s/rad", 0.03),
                    "g": (9.81, "m/s2", 0.0)},
        measured={"q_1": (1e-3, 3e-4), "q_2": (1e-3, 3e-4)},
        ports={"tau_1": Port(0, ("actuator", "cart_friction", "cart"), "w_1", "q_1", "b_1", "", 0.05),
               "tau_2": Port(1, ("actuator", "cart_friction", "cart"), "w_2", "q_2", "b_2", "", 0.05)},
        excite=mixed(0.15, 2.5, 0.8, 2.0), short=False),
    System(
        "tanks", 0.1, 240.0, 5,
        states={"h_1": ("m", 0.1, ""), "h_2": ("m", 0.1, "")},
        inputs={"u": ("V", 3.5), "q_1": ("m3/s", 0.0), "q_2": ("m3/s", 0.0)},
        parameters={"A_1": (0.004, "m2", 0.01), "A_2": (0.003, "m2", 0.01), "s_1": (2.8e-5, "m2", 0.01), "s_2": (2.6e-5, "m2", 0.01),
                    "k_p": (8e-6, "m3/(s.V)", 0.01), "g": (9.81, "m/s2", 0.0)},
        measured={"h_1": (4e-4, 1e-4), "h_2": (4e-4, 1e-4)},
        ports={"u": Port(0, ("actuator",)), "q_1": Port(1, (), "", "h_1"), "q_2": Port(2, (), "", "h_2")},
        excite=mixed(0.004, 0.06, 12.0, 35.0), pace=12.0, short=False),
    System(
        "motor", 0.0025, 12.0, 8,
        states={"phi": (RAD, 100.0, ""), "w": (SPEED, 100.0, "phi"), "i": ("A", 1.0, ""), "T": ("K", 300.0, "")},
        inputs={"V": ("V", 12.0), "tau_load": ("N.m", 0.0)},
        parameters={"R": (1.2, "Ohm", 0.01), "L": (0.012, "H", 0.01), "K": (0.05, "N.m/A", 0.005), "J": (1e-3, "kg.m2", 0.01), "b": (4e-5, "N.m.s/rad", 0.03),
                    "tau_c": (0.015, "N.m", 0.03), "w_c": (2.0, SPEED, 0.0), "alpha": (0.0039, "1/K", 0.01), "C_th": (1.5, "J/K", 0.01), "R_th": (3.0, "K/W", 0.01),
                    "T_a": (293.15, "K", 0.0)},
        measured={"w": (0.3, 0.05), "i": (0.015, 0.005), "T": (0.1, 0.02)},
        ports={"V": Port(0, ("actuator",)), "tau_load": Port(1, ("cart_friction", "cart"), "w", "phi", "b", "tau_c", 2.0)},
        excite=mixed(0.2, 5.0, 0.4, 1.5), start={"T": 293.15}),
    System(
        "cylinder", 0.002, 8.0, 5,
        states={"x": ("m", 0.05, ""), "v": ("m/s", 0.1, "x"), "p_A": ("Pa", 1e6, ""), "p_B": ("Pa", 1e6, "")},
        inputs={"u": ("V", 10.0), "F_ext": ("N", 0.0)},
        parameters={"m": (60.0, "kg", 0.01), "b": (600.0, "N.s/m", 0.03), "k": (15000.0, "N/m", 0.01), "A_A": (8e-4, "m2", 0.003), "A_B": (6e-4, "m2", 0.003),
                    "V_A": (1e-4, "m3", 0.01), "V_B": (1e-4, "m3", 0.01), "E": (2e8, "Pa", 0.03), "q_n": (2.5e-4, "m3/s", 0.005), "u_n": (10.0, "V", 0.0),
                    "p_n": (3.5e6, "Pa", 0.0), "p_s": (8e6, "Pa", 0.003), "p_t": (1e5, "Pa", 0.0), "c_i": (4e-13, "m3/(s.Pa)", 0.03)},
        measured={"x": (5e-5, 1e-5), "p_A": (1.5e4, 5e3), "p_B": (1.5e4, 5e3)},
        ports={"u": Port(0, ("actuator",)), "F_ext": Port(1, ("cart_friction", "cart"), "v", "x", "b", "", 0.01)},
        excite=mixed(0.2, 3.0, 0.6, 1.6), start={"p_A": 3.43e6, "p_B": 4.57e6}, gain=100.0),
    System(
        "furuta", 0.004, 12.0, 8,
        states={"theta": (RAD, 1.0, ""), "w_theta": (SPEED, 1.0, "theta"), "alpha": (RAD, 1.0, ""), "w_alpha": (SPEED, 1.0, "alpha")},
        inputs={"tau": ("N.m", 0.08), "tau_p": ("N.m", 0.0)},
        parameters={"J_a": (4e-3, "kg.m2", 0.01), "r": (0.2, "m", 0.003), "b_a": (0.01, "N.m.s/rad", 0.03), "k_a": (0.15, "N.m/rad", 0.01), "m": (0.13, "kg", 0.01),
                    "l": (0.16, "m", 0.003), "J_p": (1.1e-3, "kg.m2", 0.01), "b_p": (6e-4, "N.m.s/rad", 0.03), "g": (9.81, "m/s2", 0.0)},
        measured={"theta": (1e-3, 3e-4), "alpha": (1e-3, 3e-4)},
        ports={"tau": Port(0, ("actuator", "cart_friction", "cart"), "w_theta", "theta", "b_a", "", 0.05),
               "tau_p": Port(1, ("pole",), "w_alpha", "alpha", "b_p", "", 0.05)},
        excite=mixed(0.15, 2.5, 0.8, 2.0)),
]}
