"""Declared models of the machines whose laws `make_machines.py` hides: a mass on a spring, an electronic oscillator, one tank and two.

Equations of the declared models stand in equations/NAME.h and become FMUs in C by ../third_party/fmu.py; the true machines are typed
again in make_machines.py.
"""

import dataclasses
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "third_party"))
import fmu  # noqa: E402


@dataclasses.dataclass
class Declared:
    """`states`: name -> (unit, nominal, state whose derivative it is); `inputs`: name -> (unit, largest value of the records; 0: not
    fed); `parameters`: name -> (value, unit, tolerance)."""

    name: str
    states: dict
    inputs: dict
    parameters: dict
    start: dict = dataclasses.field(default_factory=dict)
    short: bool = True
    hidden: tuple = ()

    def declared(self):
        return {name: value for name, (value, _, _) in self.parameters.items()}


def spring(values):
    units = {"m": "kg", "d": "N.s/m", "k": "N/m"}
    return Declared(
        "spring",
        {"x": ("m", 0.1, ""), "v": ("m/s", 1.0, "x")},
        {"F": ("N", 1.0)},
        {name: (value, units[name], 0.0) for name, value in values.items()},
    )


def oscillator(values):
    units = {"m": "s2", "d": "s", "k": "1"}
    return Declared(
        "oscillator",
        {"y": ("V", 0.1, ""), "w": ("V/s", 10.0, "y")},
        {"u": ("V", 1.0)},
        {name: (value, units[name], 0.0) for name, value in values.items()},
    )


def cascade(values, ports):
    inputs = {"u": ("V", 1.0)} | ({"q_1": ("V/s", 0.0), "q_2": ("V/s", 0.0)} if ports else {})
    return Declared(
        "ports" if ports else "cascade",
        {"h_1": ("V", 5.0, ""), "h_2": ("V", 5.0, "")},
        inputs,
        {name: (value, "1/s" if name == "c_p" else "1", 0.0) for name, value in values.items()},
        start={"h_1": 5.0, "h_2": 5.0},
        short=False,
    )


def tank(values):
    units = {"area": "m2", "c": "m2.5/s"}
    return Declared(
        "tank",
        {"h": ("m", 0.3, "")},
        {"q": ("m3/s", 2e-4)},
        {name: (value, units[name], 0.0) for name, value in values.items()},
        start={"h": 0.3},
        short=False,
    )


def write(system, path):
    """Writes the FMU of a declared model."""
    fmu.make(system, path, pathlib.Path(__file__).parent)
