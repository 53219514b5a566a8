"""Accelerations of compass-gait against MuJoCo: `python tests/study/walker_mujoco.py`, with `pip install mujoco fmpy`.

MuJoCo has the tree without the bisection: hip on two slides, two legs on hinges with slides for the toes, and the trunk on a
hinge of its own. The trunk's angle is then tied to the mean of the legs' angles by a constant projection, which is exact, as is
the contact: MuJoCo's own soft constraints are not used. Prints the largest difference and fails above 1e-10.
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fmpy"))
import raw  # noqa: E402  (needs the path above)
from fmu import Fmu  # noqa: E402
from test_walker import ACCELERATIONS, PINNED, STATES, Walker  # noqa: E402

LEG = """
<body name="leg{i}" pos="0 0 0">
  <joint name="th{i}" type="hinge" axis="0 -1 0"/>
  <inertial pos="0 0 -0.35" mass="3.7" diaginertia="0.2 0.2 0.2"/>
  <body name="toe{i}">
    <joint name="l{i}" type="slide" axis="0 0 -1"/>
    <inertial pos="0 0 0.1" mass="0.8" diaginertia="0.005 0.005 0.005"/>
    <site name="foot{i}" pos="0 0 0"/>
  </body>
</body>
"""
MODEL = f"""
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="hip">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="1e-15" diaginertia="1e-15 1e-15 1e-15"/>
      {LEG.format(i=1)}{LEG.format(i=2)}
      <body name="trunk">
        <joint name="th3" type="hinge" axis="0 -1 0"/>
        <inertial pos="0 0 0.1" mass="6" diaginertia="0.1 0.1 0.1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
JOINTS = ["x", "y", "th1", "th2", "l1", "l2", "th3"]
# From our six coordinates to the seven of the tree.
PROJECTION = np.vstack([np.eye(6), [0, 0, 0.5, 0.5, 0, 0]])


def reference(model, state, u, feet):
    """Accelerations of the six coordinates and forces on the feet that hold."""
    data = mujoco.MjData(model)
    place = [model.joint(name).dofadr[0] for name in JOINTS]
    data.qpos[place] = PROJECTION @ state[:6]
    data.qvel[place] = PROJECTION @ state[6:]
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    h = PROJECTION.T @ full[np.ix_(place, place)] @ PROJECTION
    h[2:4, 2:4] += 0.05 * np.array([[1, -1], [-1, 1]])  # rotor on th2' - th1'
    bias = PROJECTION.T @ data.qfrc_bias[place]
    push = np.array([0, 0, -u[0], u[0], u[1], u[2]]) - bias
    rows, drift = [], []
    for i in feet:
        jacobian, rate = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        point, body = data.site(f"foot{i}").xpos, model.body(f"toe{i}").id
        mujoco.mj_jac(model, data, jacobian, None, point, body)
        mujoco.mj_jacDot(model, data, rate, None, point, body)
        rows.append((jacobian[[0, 2]][:, place]) @ PROJECTION)
        drift.append(rate[[0, 2]][:, place] @ data.qvel[place])
    if not feet:
        return np.linalg.solve(h, push), np.zeros(0)
    j, n = np.vstack(rows), 2 * len(feet)
    matrix = np.block([[h, -j.T], [j, np.zeros((n, n))]])
    both = np.linalg.solve(matrix, np.concatenate([push, -np.concatenate(drift)]))
    return both[:6], both[6:]


def main(path, folder):
    fmu, model = Fmu(path, folder), mujoco.MjModel.from_xml_string(MODEL)
    random, worst = np.random.default_rng(1), 0.0
    for mode, feet in (("flight", []), ("foot1", [1]), ("foot2", [2]), ("both", [1, 2])):
        for _ in range(50):
            state = np.array([0, 1, 0, 0, 1, 1] + [0] * 6) + random.uniform(-1, 1, 12) * ([1, 0.1, 0.6, 0.6, 0.1, 0.1] + [2] * 6)
            u = random.uniform(-1, 1, 3) * [60, 300, 300]
            with fmu.instantiate(raw.MODEL_EXCHANGE) as instance:
                w = Walker(instance)
                w.start(state, dict(zip(("tau", "F1", "F2"), map(float, u))), contact_mode=PINNED[mode])
                found = w.get(*ACCELERATIONS, *(f"foot{i}.{f}" for i in feet for f in ("ft", "fn")))
            expected = np.concatenate(reference(model, state, u, feet))
            worst = max(worst, np.max(np.abs(found - expected) / np.maximum(1, np.abs(expected))))
    print(f"largest relative difference of accelerations and forces over 200 states: {worst:.1e}")
    return 0 if worst < 1e-10 else 1


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        sys.exit(main(Path(__file__).resolve().parents[2] / "target" / "fmu" / "compass-gait.fmu", folder))
