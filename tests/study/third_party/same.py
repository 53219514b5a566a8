"""Proves that the FMUs and the machines of truth.c follow the same equations where nothing is missing, with FMPy and
CVode.

    python same.py DIR      DIR/fmu/NAME.fmu as make_third_party.py writes them

From random states under constant commands, every state of a fifth of a record agrees within 2e-5 of its range (the
tolerance of CVode is 1e-9).
"""

import pathlib
import sys

import fmpy
import numpy as np

from systems import SYSTEMS
from truth import Machine


def deviation(system, path, rng):
    """Largest difference of a state over its range."""
    n = round(system.duration / system.step / 5)
    start = np.array(
        [system.start.get(name, 0.0) + 0.3 * nominal * rng.uniform(0, 1) * (name != "T") for name, (_, nominal, _) in system.states.items()]
    )
    command = {name: (0.6 if system.name == "tanks" else 0.4) * system.inputs[name][1] * rng.uniform(0.3, 1.0) for name in system.commands}
    if system.name == "cylinder":
        start, command = np.array([0.01, 0.0, 3e6, 4.2e6]), {"u": 1.0}
    record = dict(u=np.tile(list(command.values()), (n, 1)), reference=np.zeros(n), wobble=np.zeros(n), start=start)
    own = Machine(system, system.declared(), []).run(record)
    values = dict(zip(system.states, map(float, start))) | command | {name: 0.0 for name in system.inputs if name not in command}
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=(n - 1) * system.step,
        output_interval=system.step,
        relative_tolerance=1e-9,
        start_values=values,
        output=list(system.states),
    )
    other = np.array([result[name] for name in system.states]).T[:n]
    return float((np.abs(own - other) / np.ptp(own, axis=0)).max())


if __name__ == "__main__":
    worst = {
        name: max(deviation(system, pathlib.Path(sys.argv[1]) / "fmu" / f"{name}.fmu", np.random.default_rng(k)) for k in range(3))
        for name, system in SYSTEMS.items()
    }
    for name, value in worst.items():
        print(f"{name:<10} {value:.2e} {'' if value < 2e-5 else 'DIFFERS'}")
    sys.exit(max(worst.values()) >= 2e-5)
