"""Accelerations and contact forces of compass-gait against those of another rigid-body code: `walker_mujoco.py`, `walker_drake.py`.

Their tree has no bisection: hip on two slides, two legs on hinges with slides for the toes, and the trunk on a hinge of its own.
The trunk's angle is then tied to the mean of the legs' angles by a constant projection, which is exact, as is the contact: no
soft constraints. 200 states, 50 of each contact mode.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fmpy"))
import raw  # noqa: E402  (needs the path above)
from fmu import Fmu  # noqa: E402
from test_walker import ACCELERATIONS, PINNED, Walker  # noqa: E402

# Coordinates of the tree; from our six to its seven.
JOINTS = ["x", "y", "th1", "th2", "l1", "l2", "th3"]
PROJECTION = np.vstack([np.eye(6), [0, 0, 0.5, 0.5, 0, 0]])
# Mass, inertia about the center, and the center along the body: upper leg below the hip, toe above the tip, trunk above the hip.
LEG, TOE, TRUNK = (3.7, 0.2, -0.35), (0.8, 0.005, 0.10), (6.0, 0.10, 0.10)
LARGEST = 1e-10


def solved(mass, bias, jacobian, drift, u):
    """Accelerations of the six coordinates, and forces on the feet that hold, from the terms of the tree."""
    h = PROJECTION.T @ mass @ PROJECTION
    h[2:4, 2:4] += 0.05 * np.array([[1, -1], [-1, 1]])  # rotor on th2' - th1'
    push = np.array([0, 0, -u[0], u[0], u[1], u[2]]) - PROJECTION.T @ bias
    if not len(drift):
        return np.linalg.solve(h, push)
    j, n = jacobian @ PROJECTION, len(drift)
    return np.linalg.solve(np.block([[h, -j.T], [j, np.zeros((n, n))]]), np.concatenate([push, -drift]))


def compare(name, terms):
    """Largest relative difference; `terms(q, v, feet)`: mass matrix, C v + G, Jacobian of the feet, and its rate times v."""
    path = Path(__file__).resolve().parents[2] / "target" / "fmu" / "compass-gait.fmu"
    random, worst = np.random.default_rng(1), 0.0
    with tempfile.TemporaryDirectory() as folder:
        fmu = Fmu(path, folder)
        for mode, feet in (("flight", []), ("foot1", [1]), ("foot2", [2]), ("both", [1, 2])):
            for _ in range(50):
                state = np.array([0, 1, 0, 0, 1, 1] + [0] * 6) + random.uniform(-1, 1, 12) * ([1, 0.1, 0.6, 0.6, 0.1, 0.1] + [2] * 6)
                u = random.uniform(-1, 1, 3) * [60, 300, 300]
                with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
                    w = Walker(instance)
                    w.start(state, dict(zip(("tau", "F1", "F2"), map(float, u))), contact_mode=PINNED[mode])
                    found = w.get(*ACCELERATIONS, *(f"foot{i}.{f}" for i in feet for f in ("ft", "fn")))
                expected = solved(*terms(PROJECTION @ state[:6], PROJECTION @ state[6:], feet), u)
                worst = max(worst, np.max(np.abs(found - expected) / np.maximum(1, np.abs(expected))))
    print(f"{name}: largest relative difference of accelerations and forces over 200 states: {worst:.1e}")
    return 0 if worst < LARGEST else 1
