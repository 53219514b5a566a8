"""Accelerations of compass-gait against MuJoCo: `python tests/study/walker_mujoco.py`, with `pip install mujoco fmpy`.

Prints the largest difference and fails above 1e-10.
"""

import sys

import mujoco
import numpy as np
from walker_accelerations import JOINTS, LEG, TOE, TRUNK, compare


def inertial(body):
    mass, inertia, center = body
    return f'<inertial pos="0 0 {center}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'


def leg(i):
    return f"""
<body name="leg{i}" pos="0 0 0">
  <joint name="th{i}" type="hinge" axis="0 -1 0"/>
  {inertial(LEG)}
  <body name="toe{i}">
    <joint name="l{i}" type="slide" axis="0 0 -1"/>
    {inertial(TOE)}
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
      {leg(1)}{leg(2)}
      <body name="trunk">
        <joint name="th3" type="hinge" axis="0 -1 0"/>
        {inertial(TRUNK)}
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def main():
    model = mujoco.MjModel.from_xml_string(MODEL)
    place = [model.joint(name).dofadr[0] for name in JOINTS]

    def terms(q, v, feet):
        data = mujoco.MjData(model)
        data.qpos[place], data.qvel[place] = q, v
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        rows, drift = [np.zeros((0, model.nv))], []
        for i in feet:
            jacobian, rate = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            point, body = data.site(f"foot{i}").xpos, model.body(f"toe{i}").id
            mujoco.mj_jac(model, data, jacobian, None, point, body)
            mujoco.mj_jacDot(model, data, rate, None, point, body)
            rows.append(jacobian[[0, 2]])
            drift.extend(rate[[0, 2]] @ data.qvel)
        return full[np.ix_(place, place)], data.qfrc_bias[place], np.vstack(rows)[:, place], np.array(drift)

    return compare("MuJoCo", terms)


if __name__ == "__main__":
    sys.exit(main())
