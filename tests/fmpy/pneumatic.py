"""The pneumatic cart-pole of example 01 for third-party tools: its wiring typed again, a command, runs of `airloop`."""

import csv

import numpy as np

from command import airloop  # noqa: F401  (for the tests that use this file)
from test_examples import SYSTEM  # noqa: F401

# Component -> FMU, in evaluation order: each gets its force from the one before.
FMUS = {
    "actuator": "arx-actuator",
    "piston_friction": "friction",
    "cart_friction": "friction",
    "cart_pole": "cart-pole",
}
CONNECTIONS = [
    ("actuator", "F_act", "piston_friction", "F_in"),
    ("piston_friction", "F_out", "cart_friction", "F_in"),
    ("cart_friction", "F_out", "cart_pole", "F"),
    ("cart_pole", "v", "piston_friction", "v"),
    ("cart_pole", "v", "cart_friction", "v"),
]
CART = {"c1": 5.7910, "c2": 63.7045, "c3": 0.0064, "c4": 0.0, "c5": -2.3170}  # eq. 11
# Sampled outputs: the value read after a step belongs to the beginning of it.
HELD = {("actuator", "F_hat"), ("actuator", "F_act")}


def sine(times):
    """Command [N]: 20 N, 1 Hz."""
    return [20.0 * float(np.sin(2.0 * np.pi * t)) for t in times]


def run(folder, system, step, times, command, master, *options):
    """`airloop run` with a command held between `times`; columns by name."""
    folder.mkdir(parents=True, exist_ok=True)
    if command is not None:
        with open(folder / "command.csv", "w", newline="") as file:
            csv.writer(file).writerows([["time", "u"], *([repr(t), repr(u)] for t, u in zip(times, command))])
        options += ("--input", folder / "command.csv", "--interpolation", "hold")
    span = ("--stop", repr(times[-1]), "--step", step, "--master", master)
    airloop("run", system, *span, *options, "--no-plots", "-q", "-o", folder)
    result = np.genfromtxt(folder / "result.csv", delimiter=",", names=True, deletechars="")
    assert result["time"].tolist() == list(times)
    return result


def differences(result, columns):
    """Greatest difference of each column {(component, variable): values} from the result of `run`."""
    return {
        f"{component}.{variable}": float(np.max(np.abs(result[f"{component}.{variable}"] - np.array(values))))
        for (component, variable), values in columns.items()
    }


def at_start_of_interval(columns):
    """Sampled outputs as `result.csv` has them: moved to the beginning of the step they were read after."""
    return {key: [*values[1:], values[-1]] if key in HELD else values for key, values in columns.items()}
