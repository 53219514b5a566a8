"""The half step of example 04 in one problem: toes and motion at once."""

import numpy as np
import pytest
from lxml import etree
from scipy.linalg import expm, logm

from test_half_step import EXPECTED, FOLDER, OBJECTIVE_B, columns, plan  # noqa: F401  (a fixture)

# Eq. 12: y(k) + A1 y(k-1) = B0 u(k) + B1 u(k-1), y = s + B0 u.
A1, B0, B1 = np.array([[-1.0081, 0.024], [-0.0447, -0.9502]]), np.array([0.6297, 0.0503]), np.array([-0.6141, -0.046])
AD, BD, SAMPLE = -A1, B1 - A1 @ B0, 1e-3
CONTINUOUS = logm(np.block([[AD, BD[:, None]], [np.zeros((1, 2)), np.eye(1)]])).real[:2] / SAMPLE
# Of the same problem, typed by hand (tests/study/walker_casadi.py), by IPOPT on the same mesh.
OBJECTIVE_IPOPT = EXPECTED["variants"]["J"]["objective"]["value"]


@pytest.fixture(scope="module")
def joint(plan):  # noqa: F811
    return plan("--variant", "J")


def test_the_toe_behind_the_rate_of_its_command_is_that_of_eq_12():
    values = {one.get("name"): float(one[0].get("value")) for one in etree.parse(FOLDER / "toe_rate.ssv").iter("{*}Parameter")}
    read = lambda name, *shape: np.array([[values[f"{name}[{i},{j}]"] for j in range(1, shape[1] + 1)] for i in range(1, shape[0] + 1)])  # noqa: E731
    slopes = np.zeros((4, 4))
    slopes[:2, :3], slopes[2, 3] = CONTINUOUS, 1
    sampled = expm(slopes * SAMPLE)
    np.testing.assert_allclose(read("A", 3, 3), sampled[:3, :3], atol=1e-13)
    np.testing.assert_allclose(read("B", 3, 1), sampled[:3, 3:], atol=1e-13)
    np.testing.assert_allclose(read("C", 2, 3), [[0, 1, B0[1]], CONTINUOUS[1]], atol=1e-12)
    np.testing.assert_allclose(read("D", 2, 1), [[0], [B0[1]]], atol=1e-15)


def test_the_joint_problem_has_the_optimum_of_an_independent_formulation(joint):
    summary, _, _ = joint
    assert summary["status"] == "solved"
    assert summary["objective"] == pytest.approx(OBJECTIVE_IPOPT, abs=1e-6)
    # The toes cost nothing but the rates of commands.
    assert summary["objective"] == pytest.approx(OBJECTIVE_B, abs=1e-6)
    assert summary["max_defect"] < 1e-8 and summary["max_bound_violation"] < 1e-8


def test_toes_start_at_rest_and_hold_their_forces_at_the_end(joint):
    _, table, _ = joint
    for toe, begin, end in ((1, 139.302, -7.848), (2, -7.848, 139.302)):
        states = columns(table, *(f"toe{toe}.x[{i}]" for i in (1, 2, 3)))
        np.testing.assert_allclose(CONTINUOUS @ states[0], 0, atol=1e-9)
        force = states[:, 1] + B0[1] * states[:, 2]
        np.testing.assert_allclose(1055.5751 * force[[0, -1]], [begin, end], atol=1e-4)
        np.testing.assert_allclose(table[f"toe{toe}.y[1]"], force, atol=1e-12)
        assert (np.abs(states[:, 2]) <= 1).all()
