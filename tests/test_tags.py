"""Tags: what their variables mean, how they slow down, and what is refused."""

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

from ocp_traj.curves.families import nonic
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.tags import Tags
from ocp_traj.robot.joint_limits import JointLimits

LIMITS = JointLimits(position=((-1.0, -2.0), (1.0, 2.0)), velocity=(1.0, 2.0), acceleration=(3.0, 4.0),
                     jerk=(5.0, 6.0), snap=(7.0, 8.0))  # fmt: skip
HELD = np.array([0.3, -0.4])
UNIT = 2.5  # [s]
TAGS = Tags({"a": None, "b": HELD}, LIMITS, ("x", "y"), UNIT)


def states(tags: Tags, x: np.ndarray) -> list[np.ndarray]:
    symbol = ca.SX.sym("x", len(x))
    return [np.array(state) for state in ca.Function("f", [symbol], tags.states(symbol)).call([x])]


def test_a_variable_is_a_derivative_times_a_power_of_the_unit() -> None:
    x = np.random.default_rng(0).normal(size=TAGS.size + 2)
    free, held = states(TAGS, x)
    for order in range(5):
        assert_allclose(free[order] * UNIT**order, x[2 * order : 2 * order + 2], rtol=1e-14)
        expected = x[8 + 2 * order : 10 + 2 * order] if order else HELD
        assert_allclose(held[order] * UNIT**order, expected, rtol=1e-14)


def test_bounds_are_the_limits_of_the_derivatives() -> None:
    blocks = TAGS.variables("rad", "here")
    assert [v.id for v in blocks] == [f"{o} at a" for o in ("q", "v", "a", "jerk", "snap")] + [
        f"{o} at b" for o in ("v", "a", "jerk", "snap")
    ]
    assert blocks[0].labels == ("a q x", "a q y") and {v.eq for v in blocks} == {"here"}
    assert_allclose(blocks[4].upper, [7.0 * UNIT**4, 8.0 * UNIT**4])
    assert_allclose(blocks[5].lower, [-1.0 * UNIT, -2.0 * UNIT])


def test_dilation_is_that_of_the_curve() -> None:
    x, s = np.append(np.random.default_rng(1).normal(size=TAGS.size), 1.7), 1.3
    for slower, one in zip(
        nonic(states(TAGS, TAGS.dilate(x, s)), np.array([s * x[-1]])).control_points,
        nonic(states(TAGS, x), x[-1:]).control_points,
        strict=True,
    ):
        assert_allclose(slower, one, rtol=1e-12)


def test_tags_at_rest_have_no_variables_and_no_derivatives() -> None:
    tags = Tags({"b": HELD}, JointLimits(), ("x", "y"), UNIT, rest=True)
    assert tags.size == 0 and tags.variables("rad") == ()
    (state,) = states(tags, np.ones(1))
    assert (state[0] == HELD).all() and not state[1:].any()


def test_what_is_no_tag_is_refused() -> None:
    with pytest.raises(ProblemDefinitionError, match="tags a rest at no position"):
        Tags({"a": None, "b": HELD}, LIMITS, ("x", "y"), UNIT, rest=True)
    with pytest.raises(ProblemDefinitionError, match="tags need limits of a, jerk, snap, which bound"):
        Tags({"b": HELD}, JointLimits(velocity=(1.0, 1.0)), ("x", "y"), UNIT)
