"""Accelerations of compass-gait against Drake: `python tests/study/walker_drake.py`, with `pip install drake fmpy`.

Prints the largest difference and fails above 1e-10.
"""

import sys

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, PrismaticJoint, RevoluteJoint, RotationalInertia, SpatialInertia
from walker_accelerations import JOINTS, LEG, TOE, TRUNK, compare

RIGHT, UP, TURN = [1, 0, 0], [0, 0, 1], [0, -1, 0]


def inertia(mass, about_center, center):
    own = RotationalInertia(about_center, about_center, about_center)
    return SpatialInertia.MakeFromCentralInertia(mass, [0, 0, center], own)


def tree():
    """The plant, and the bodies of the toes, whose origins are the tips."""
    plant = MultibodyPlant(0.0)

    def body(name, parent, joint, axis, spatial=None):
        added = plant.AddRigidBody(name, spatial or SpatialInertia.Zero())
        plant.AddJoint(joint(name, parent.body_frame(), added.body_frame(), axis))
        return added

    slide = body("x", plant.world_body(), PrismaticJoint, RIGHT)
    hip = body("y", slide, PrismaticJoint, UP)
    legs = [body(f"th{i}", hip, RevoluteJoint, TURN, inertia(*LEG)) for i in (1, 2)]
    toes = [body(f"l{i}", leg, PrismaticJoint, [0, 0, -1], inertia(*TOE)) for i, leg in zip((1, 2), legs)]
    body("th3", hip, RevoluteJoint, TURN, inertia(*TRUNK))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -9.81])
    plant.Finalize()
    return plant, toes


def main():
    plant, toes = tree()
    context = plant.CreateDefaultContext()
    place = [plant.GetJointByName(name).velocity_start() for name in JOINTS]
    world, tip = plant.world_frame(), np.zeros(3)

    def terms(q, v, feet):
        positions, velocities = np.zeros(7), np.zeros(7)
        positions[place], velocities[place] = q, v
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, velocities)
        mass = plant.CalcMassMatrix(context)[np.ix_(place, place)]
        bias = plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context)
        rows, drift = [np.zeros((0, 7))], []
        for i in feet:
            of_tip = (context, JacobianWrtVariable.kV, toes[i - 1].body_frame(), tip, world, world)
            rows.append(plant.CalcJacobianTranslationalVelocity(*of_tip)[[0, 2]])
            drift.extend(plant.CalcBiasTranslationalAcceleration(*of_tip)[[0, 2], 0])
        return mass, bias[place], np.vstack(rows)[:, place], np.array(drift)

    return compare("Drake", terms)


if __name__ == "__main__":
    sys.exit(main())
