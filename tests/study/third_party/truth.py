"""Effects with their parameters for a system, and noise-free records of the real machine (truth.c).
"""
import ctypes
import os
import pathlib
import subprocess
import tempfile

import numpy as np

from systems import SYSTEMS

# Numbers of the kinds in truth.c.
CODES = {name: k for k, name in enumerate(
    "viscous coulomb stribeck spring endstop cogging quaddrag offset asymmetry poscoulomb leakage overflow load_friction".split())}
# The same equations along a current.
CODES |= {"resistance": CODES["viscous"], "voltage_drop": CODES["coulomb"]}
CODES |= {name: 20 + k for k, name in enumerate("cubic bump speedbump product wander power teeth cross heat".split())}
CODES |= {name: 40 + k for k, name in enumerate("gain command_offset deadband saturation hysteresis delay lag mode ratelimit droop".split())}
CODES |= {name: 60 + k for k, name in enumerate("kink command_cubic command_wander command_bump heatgain".split())}

# Kind: parameters and their units; the first is the main one. Units: F of the force at the port, V of its velocity, X of
# its position, U of the command, Y of the sensor.
PARAMETERS = {
    "viscous": {"coef": "F/V"}, "coulomb": {"force": "F"}, "stribeck": {"force": "F", "vs": "V"}, "spring": {"stiffness": "F/X", "rest": "X"},
    "endstop": {"stiffness": "F/X", "damping": "F/V", "pos": "X"}, "cogging": {"amp": "F", "period": "X", "phase": "rad"}, "quaddrag": {"coef": "F/V2"},
    "offset": {"value": "F"}, "asymmetry": {"force": "F"}, "poscoulomb": {"slope": "F/X"}, "leakage": {"coef": "F/X0.5"},
    "load_friction": {"coef": "1"}, "resistance": {"coef": "U/A"}, "voltage_drop": {"drop": "U", "vt": "A"},
    "gain": {"gain": "1"}, "command_offset": {"value": "U"}, "deadband": {"width": "U"}, "saturation": {"limit": "U"}, "hysteresis": {"width": "U"},
    "delay": {"delay": "s"}, "lag": {"tau": "s"}, "mode": {"freq": "Hz", "zeta": "1"}, "ratelimit": {"rate": "U/s"}, "droop": {"depth": "1", "tau": "s"},
    "sensor_gain": {"gain": "1"}, "sensor_offset": {"value": "Y"}, "sensor_delay": {"delay": "s"}, "parameter": {"change": "1"},
}
MAIN = {"endstop": "pos"}


class Effect(ctypes.Structure):
    _fields_ = [("kind", ctypes.c_int), ("port", ctypes.c_int), ("q", ctypes.c_double * 6)]


def _library():
    target = pathlib.Path(tempfile.mkdtemp()) / "truth.so"
    source = pathlib.Path(__file__).parent / "truth.c"
    subprocess.run([os.environ.get("CC", "gcc"), "-O2", "-shared", "-fPIC", "-o", target, source, "-lm"], check=True)
    library = ctypes.CDLL(str(target))
    pointer, number = ctypes.POINTER(ctypes.c_double), ctypes.c_double
    library.simulate.argtypes = [ctypes.c_int, pointer, ctypes.POINTER(Effect), ctypes.c_int, pointer, pointer, pointer, number, number, number,
                                 ctypes.c_long, ctypes.c_int, pointer, pointer]
    return library


LIBRARY = _library()


def scales(system, port, records):
    """What typically happens at a port in these records: force, speed, range of the position, largest command."""
    own = system.ports[port]
    column = lambda name: np.concatenate([r["x"][:, list(system.states).index(name)] for r in records])
    velocity, position = column(own.velocity) if own.velocity else np.ones(1), column(own.position) if own.position else np.array([0.0, 1.0])
    # The force of the drive: at a port without command, what the first command amounts to there.
    force = {"servo": 0.5, "motor": 0.15, "cylinder": 600.0, "tanks": 5e-5, "furuta": 0.08 if own.index == 0 else 0.03, "arm": 4.0 if own.index == 0 else 1.4}[system.name]
    command = 0.0
    if port in system.commands:
        command = max(np.abs(r["u"][:, system.commands.index(port)]).max() for r in records)
    low, high = np.quantile(position, [0.002, 0.998])
    return dict(F=force, V=np.sqrt(np.mean(velocity**2)), low=low, X=high - low, U=command, step=system.step, pace=system.pace, T=len(records[0]["x"]) * system.step,
                vt=own.vt or 1.0, swing=np.ptp(np.concatenate([r["u"] for r in records])[:, 0]))


def parameters(kind, strength, z, s):
    """Parameters of an effect; z: three numbers within 0 ... 1 that decide its shape, s: see scales."""
    F, V, X, U, step = s["F"] * strength, s["V"], s["X"], s["U"], s["step"]
    sign = 1.0 if z[2] > 0.5 else -1.0
    whole = max(1.0, np.round(strength * s.get("pace", 1.0)))
    match kind:
        case "viscous": return dict(coef=0.1 * F / V)
        case "coulomb": return dict(force=0.1 * F)
        case "stribeck": return dict(force=0.2 * F, vs=V * (0.1 + 0.2 * z[0]))
        case "spring": return dict(stiffness=0.2 * F / X, rest=s["low"] + X * (0.3 + 0.4 * z[0]))
        case "endstop": return dict(stiffness=3.0 * F / X, damping=0.02 * 3.0 * F / X, pos=s["low"] + X * (0.74 + 0.14 * z[0]))
        case "cogging": return dict(amp=0.15 * F, period=X / (3.0 + 4.0 * z[0]), phase=6.28 * z[1] - 3.14)
        case "quaddrag": return dict(coef=0.1 * F / V**2)
        case "offset": return dict(value=0.04 * F * sign)
        case "asymmetry": return dict(force=0.1 * F * sign)
        case "poscoulomb": return dict(slope=0.3 * F / X)
        case "leakage": return dict(coef=0.1 * F / np.sqrt(0.15))
        case "overflow": return dict(coef=3.0 * F / X, level=s["low"] + X * (0.7 + 0.15 * z[0]))
        case "load_friction": return dict(coef=0.1 * strength)
        case "resistance": return dict(coef=0.1 * strength)
        case "voltage_drop": return dict(drop=0.04 * U * strength, vt=0.05)
        case "gain": return dict(gain=0.05 * strength * sign)
        case "command_offset": return dict(value=0.02 * strength * s["swing"] * sign)
        case "deadband": return dict(width=0.04 * strength * U)
        case "saturation": return dict(limit=U * max(0.35, 1.0 - 0.12 * strength))
        case "hysteresis": return dict(width=0.02 * strength * s["swing"])
        case "delay" | "sensor_delay": return dict(delay=whole * step)
        case "lag": return dict(tau=s["pace"] * strength * step)
        case "mode": return dict(freq=0.05 / step / strength, zeta=0.3 + 0.5 * z[0])
        case "ratelimit": return dict(rate=s["swing"] / (0.02 * s["T"]) / strength)
        case "droop": return dict(depth=0.08 * strength, tau=s["T"] * (0.08 + 0.15 * z[0]))
        case "sensor_gain": return dict(gain=0.03 * strength * sign)
        case "sensor_offset": return dict(value=s["Y"] * 0.02 * strength * sign)
        case "parameter": return dict(change=0.1 * strength)
        # Forms that no list has.
        case "cubic": return dict(coef=1.2 * F / X**3)
        case "bump": return dict(amp=0.15 * F * sign, at=s["low"] + X * (0.3 + 0.4 * z[0]), width=X * (0.06 + 0.08 * z[1]))
        case "speedbump": return dict(amp=0.2 * F * sign, at=V * (0.4 + 0.8 * z[0]), width=V * (0.15 + 0.2 * z[1]))
        case "product": return dict(coef=0.3 * F / X / V, at=s["low"] + X * (0.3 + 0.4 * z[0]))
        case "wander": return dict(amp=0.05 * F, freq=(2.0 + 4.0 * z[0]) / s["T"], phase=6.28 * z[1])
        case "power": return dict(coef=0.08 * F / V ** (0.3 + 0.4 * z[0]), exponent=0.3 + 0.4 * z[0])
        case "teeth": return dict(amp=0.1 * F, period=X / (2.0 + 6.0 * z[0]), phase=6.28 * z[1])
        case "cross": return dict(force=0.12 * F, speed=0.2)
        case "heat": return dict(coef=-0.008 * F, temperature=293.15)
        case "heatgain": return dict(coef=0.003 * strength, temperature=293.15)
        case "kink": return dict(slope=0.05 * strength, at=U * (0.2 + 0.4 * z[0]))
        case "command_cubic": return dict(coef=0.05 * strength / max(U, 1e-9) ** 2 * sign)
        case "command_wander": return dict(depth=0.03 * strength, freq=(2.0 + 4.0 * z[0]) / s["T"], phase=6.28 * z[1])
        case "command_bump": return dict(amp=0.03 * strength * U * sign, at=U * (z[0] - 0.5), width=U * (0.1 + 0.2 * z[1]))
    raise ValueError(kind)


def row(kind, values, port, s):
    """The effect as truth.c knows it; None for those of sensors and parameters."""
    if kind.startswith("sensor") or kind == "parameter":
        return None
    q = list(values.values())
    q += [s["vt"]] * (kind in ("coulomb", "stribeck", "asymmetry", "poscoulomb", "heat", "load_friction"))
    return Effect(CODES[kind], port, (ctypes.c_double * 6)(*q))


class Machine:
    """A system with its true parameters and effects: a list of (kind, port, values, scales)."""

    def __init__(self, system, values, effects):
        self.system, self.values, self.effects = system, dict(values), effects
        for kind, port, own, _ in effects:
            if kind == "parameter":
                self.values[port] *= 1.0 + own["change"]

    def run(self, record, closed=False):
        """States `[n, nx]` of a record; with `closed`, commands under feedback are written back."""
        system = self.system
        rows = [r for r in (row(kind, values, system.ports[port].index if port in system.ports else -1, s) for kind, port, values, s in self.effects) if r]
        sent = np.ascontiguousarray(record["sent"] if closed else record["u"], dtype=float).copy()
        n, out = len(sent), np.zeros((len(sent), len(system.states)))
        p = np.array(list(self.values.values()))
        pointer = lambda a: np.ascontiguousarray(a, dtype=float).ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        keep = [p, np.ascontiguousarray(record["reference"]), np.ascontiguousarray(record["wobble"]), np.array(record["start"])]
        failed = LIBRARY.simulate(list(SYSTEMS).index(system.name), pointer(keep[0]), (Effect * max(len(rows), 1))(*rows), len(rows), pointer(sent), pointer(keep[1]),
                                  pointer(keep[2]), system.gain if closed else 0.0, 10.0, system.step, n, system.inner, pointer(keep[3]), pointer(out))
        if failed:
            raise ArithmeticError("states run away")
        if closed:
            record["u"] = sent
        return out

    def sense(self, states):
        """What sensors without noise show: name -> `[n]`."""
        system, found = self.system, {}
        for name in system.measured:
            y = states[:, list(system.states).index(name)].copy()
            for kind, port, own, _ in self.effects:
                if port != name:
                    continue
                if kind == "sensor_gain":
                    y *= 1.0 + own["gain"]
                elif kind == "sensor_offset":
                    y += own["value"]
                elif kind == "sensor_delay":
                    back = round(own["delay"] / system.step)
                    y = np.concatenate([np.full(back, y[0]), y[:-back]])
            found[name] = y
        return found
