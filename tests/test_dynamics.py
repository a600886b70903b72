"""Symbolic dynamics and kinematics against pinocchio's."""

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from casadi import SX

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError, OcpTrajError, RobotDefinitionError, UnsupportedJoint
from ocp_traj.robot.dynamics import Payload, Wrench, forward_kinematics, inverse_dynamics, joint_friction
from tests.random_robots import random_inertia, random_model, random_placement, random_states

TOLERANCE = 1e-9  # [-], of max |tau|: the agreement the design asks for

MODELS = {
    "one revolute": lambda rng: random_model(rng, 1, kinds=("revolute",)),
    "one prismatic": lambda rng: random_model(rng, 1, kinds=("prismatic",), aligned=False),
    "two, aligned": lambda rng: random_model(rng, 2, aligned=True),
    "three prismatic": lambda rng: random_model(rng, 3, kinds=("prismatic",)),
    "three, tree": lambda rng: random_model(rng, 3, branching=True),
    "four, unaligned": lambda rng: random_model(rng, 4, aligned=False),
    "five, mixed": lambda rng: random_model(rng, 5),
    "six revolute, aligned": lambda rng: random_model(rng, 6, kinds=("revolute",), aligned=True),
    "six revolute, unaligned": lambda rng: random_model(rng, 6, kinds=("revolute",), aligned=False),
    "six, tree": lambda rng: random_model(rng, 6, branching=True),
    "seven, aligned": lambda rng: random_model(rng, 7, aligned=True),
    "seven, mixed": lambda rng: random_model(rng, 7),
    "seven, tree": lambda rng: random_model(rng, 7, branching=True),
    "pinocchio's manipulator": lambda rng: pin.buildSampleModelManipulator(),
}


def make_model(name: str) -> pin.Model:
    return MODELS[name](np.random.default_rng(list(MODELS).index(name)))


def rnea(model: pin.Model, states: tuple[Array, Array, Array], wrench_on_last: pin.Force | None = None) -> Array:
    """Torques of pinocchio, ``(nv, count)``."""
    data = model.createData()
    if wrench_on_last is None:
        return np.stack([pin.rnea(model, data, *state) for state in zip(*(x.T for x in states), strict=True)], axis=1)
    external = pin.StdVec_Force()
    for i in range(model.njoints):
        external.append(wrench_on_last if i == model.njoints - 1 else pin.Force.Zero())
    columns = zip(*(x.T for x in states), strict=True)
    return np.stack([pin.rnea(model, data, *state, external) for state in columns], axis=1)


def symbolic(model: pin.Model, **options: Any) -> Callable[..., Array]:
    """Our torques as a function of (q, v, a), each ``(nv, count)``."""
    q, v, a = (SX.sym(name, model.nv) for name in "qva")
    function = ca.Function("tau", [q, v, a], [inverse_dynamics(model, q, v, a, **options)])
    return lambda states: np.asarray(function.map(states[0].shape[1])(*states))


def relative_error(ours: Array, theirs: Array) -> float:
    """Largest error over all states, each relative to its own max |tau|."""
    return float(np.max(np.abs(ours - theirs).max(axis=0) / (np.abs(theirs).max(axis=0) + 1e-12)))


@pytest.mark.parametrize("name", MODELS)
def test_inverse_dynamics_equals_pinocchio_rnea(name: str) -> None:
    model = make_model(name)
    states = random_states(np.random.default_rng(1), model.nv, 1000)
    assert relative_error(symbolic(model)(states), rnea(model, states)) <= TOLERANCE


def test_inverse_dynamics_equals_mass_matrix_times_acceleration_plus_bias() -> None:
    model = make_model("seven, mixed")
    q, v, a = (SX.sym(name, model.nv) for name in "qva")
    tau = inverse_dynamics(model, q, v, a)
    mass = ca.jacobian(tau, a)
    residual = ca.Function("f", [q, v, a], [tau - mass @ a - ca.substitute(tau, a, SX.zeros(model.nv)), mass - mass.T])
    for state in zip(*(x.T for x in random_states(np.random.default_rng(2), model.nv, 20)), strict=True):
        affine, asymmetry = (np.asarray(x) for x in residual(*state))
        scale = np.abs(rnea(model, tuple(x[:, None] for x in state))).max()
        assert np.abs(affine).max() <= 1e-12 * scale
        assert np.abs(asymmetry).max() <= 1e-12 * scale


def test_graph_of_a_six_axis_arm_stays_small() -> None:
    q, v, a = (SX.sym(name, 6) for name in "qva")
    tau = inverse_dynamics(pin.buildSampleModelManipulator(), q, v, a)
    assert ca.Function("tau", [q, v, a], [tau]).n_instructions() <= 360  # 346 when written


@pytest.mark.parametrize("name", ["five, mixed", "seven, tree", "six revolute, unaligned"])
@pytest.mark.parametrize("last", [True, False], ids=["on the last link", "on another link"])
@pytest.mark.parametrize("extended", [True, False], ids=["body", "point mass"])
def test_symbolic_payload_equals_appended_body(name: str, last: bool, extended: bool) -> None:
    model, rng = make_model(name), np.random.default_rng(3)
    body = random_inertia(rng)
    body = body if extended else pin.Inertia(body.mass, body.lever, np.zeros((3, 3)))
    mass, centre, inertia = SX.sym("m"), SX.sym("c", 3), SX.sym("I", 3, 3)
    payload = Payload(mass, centre, inertia if extended else None, None if last else "joint2")
    q, v, a = (SX.sym(n, model.nv) for n in "qva")
    tau = inverse_dynamics(model, q, v, a, payload=payload)
    function = ca.Function("tau", [q, v, a, mass, centre, inertia], [tau])
    states = random_states(rng, model.nv, 100)
    ours = np.asarray(function.map("batch", "serial", 100, [3, 4, 5], [])(*states, body.mass, body.lever, body.inertia))
    loaded = model.copy()
    loaded.appendBodyToJoint(model.njoints - 1 if last else model.getJointId("joint2"), body, pin.SE3.Identity())
    assert relative_error(ours, rnea(loaded, states)) <= TOLERANCE
    numeric = symbolic(model, payload=Payload(body.mass, body.lever, body.inertia if extended else None, payload.joint))
    assert relative_error(numeric(states), rnea(loaded, states)) <= TOLERANCE
    assert ca.Function("f", [q, v, a, centre, inertia], [ca.jacobian(ca.jacobian(tau, mass), mass)]).nnz_out() == 0


def test_tool_wrench_equals_opposite_external_force() -> None:
    model, rng = make_model("seven, mixed"), np.random.default_rng(4)
    force, moment, point = (rng.normal(scale=s, size=3) for s in (50.0, 10.0, 0.3))
    states = random_states(rng, model.nv, 200)
    on_the_link = pin.Force(-force, -(moment + np.cross(point, force)))
    ours = symbolic(model, tool_wrench=(force, moment, point))(states)
    assert relative_error(ours, rnea(model, states, on_the_link)) <= TOLERANCE
    named = symbolic(model, tool_wrench=Wrench(SX(force), SX(moment), SX(point), model.names[-1]))(states)
    assert relative_error(named, ours) <= 1e-14


def test_gravity_argument_replaces_the_models() -> None:
    model, rng = make_model("six, tree"), np.random.default_rng(5)
    states, gravity = random_states(rng, model.nv, 200), rng.normal(size=3)
    ours = symbolic(model, gravity=gravity)(states)
    model.gravity.linear = gravity
    assert relative_error(ours, rnea(model, states)) <= TOLERANCE


@pytest.mark.parametrize("name", MODELS)
def test_forward_kinematics_equals_pinocchio(name: str) -> None:
    model, rng = make_model(name), np.random.default_rng(6)
    data, q = model.createData(), SX.sym("q", model.nv)
    for index in range(1, model.njoints):
        placement = random_placement(rng)
        for joint, fixed in ((index, placement), (model.names[index], None)):
            function = ca.Function("pose", [q], forward_kinematics(model, q, joint, fixed))
            for state in random_states(rng, model.nv, 10)[0].T:
                pin.forwardKinematics(model, data, state)
                expected = data.oMi[index] * (fixed or pin.SE3.Identity())
                rotation, position = (np.asarray(x) for x in function(state))
                assert np.abs(rotation - expected.rotation).max() <= 1e-13
                assert np.abs(position[:, 0] - expected.translation).max() <= 1e-12


def test_last_joint_is_the_default_of_forward_kinematics() -> None:
    model, q = make_model("three, tree"), SX.sym("q", 3)
    pair = ca.vertcat(*(ca.vec(x) for x in forward_kinematics(model, q)))
    named = ca.vertcat(*(ca.vec(x) for x in forward_kinematics(model, q, "joint3")))
    difference = ca.Function("f", [q], [pair - named])
    assert np.abs(np.asarray(difference([0.3, -0.2, 0.9]))).max() == 0.0


def test_axis_against_a_coordinate_axis() -> None:
    model = pin.Model()
    for i, axis in enumerate(-np.eye(3)):
        rng = np.random.default_rng(i)
        index = model.addJoint(i, pin.JointModelRevoluteUnaligned(axis), random_placement(rng), f"j{i}")
        model.appendBodyToJoint(index, random_inertia(rng), pin.SE3.Identity())
    states = random_states(np.random.default_rng(7), 3, 100)
    assert relative_error(symbolic(model)(states), rnea(model, states)) <= TOLERANCE


def test_friction_is_odd_smooth_and_saturates() -> None:
    v = SX.sym("v", 2)
    friction = ca.Function("f", [v], [joint_friction(v, [3.0, 5.0], [0.5, 0.0], 0.01)])
    assert np.asarray(friction([0.0, 0.0])).tolist() == [[0.0], [0.0]]
    assert np.asarray(friction([2.0, -1.0]))[:, 0] == pytest.approx([4.0, -5.0], rel=1e-12)
    assert float(friction([0.01, 0.0])[0]) == pytest.approx(3.0 * np.tanh(1.0) + 0.005, rel=1e-12)
    with pytest.raises(InputError, match=r"coulomb has shape \(3, 1\), expected a scalar or \(2, 1\)"):
        joint_friction(v, [1.0, 2.0, 3.0], 0.0, 0.1)
    with pytest.raises(InputError, match="velocity_scale is 0.0, expected > 0"):
        joint_friction(v, 1.0, 0.0, 0.0)


def composite() -> Any:
    joint = pin.JointModelComposite(pin.JointModelRX())
    joint.addJoint(pin.JointModelRY())
    return joint


UNSUPPORTED = {
    "RUBX": pin.JointModelRUBX,
    "RevoluteUnboundedUnaligned": pin.JointModelRevoluteUnboundedUnaligned,
    "HZ": lambda: pin.JointModelHZ(0.1),
    "HelicalUnaligned": lambda: pin.JointModelHelicalUnaligned(np.array([0.6, 0.0, 0.8]), 0.1),
    "FreeFlyer": pin.JointModelFreeFlyer,
    "Planar": pin.JointModelPlanar,
    "Spherical": pin.JointModelSpherical,
    "SphericalZYX": pin.JointModelSphericalZYX,
    "Translation": pin.JointModelTranslation,
    "Universal": lambda: pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])),
    "Composite": composite,
}


@pytest.mark.parametrize("kind", UNSUPPORTED)
def test_unsupported_joint_is_named(kind: str) -> None:
    model = random_model(np.random.default_rng(0), 2)
    model.addJoint(2, UNSUPPORTED[kind](), pin.SE3.Identity(), "elbow")
    x = SX.sym("x", model.nv)
    with pytest.raises(UnsupportedJoint, match=rf"joint 'elbow' of 'random' is a {kind}.*allowed are RX.*lock a mimic"):
        inverse_dynamics(model, x, x, x)
    with pytest.raises(UnsupportedJoint, match="'elbow'"):
        forward_kinematics(model, x)


def test_mimic_joint_is_refused() -> None:
    model = random_model(np.random.default_rng(0), 1, kinds=("revolute",), aligned=True)
    follower = pin.JointModelMimic(model.joints[1], 2.0, 0.0)
    model.addJoint(1, follower, pin.SE3.Identity(), "finger")
    with pytest.raises(UnsupportedJoint, match="joint 'finger' of 'random' is a Mimic"):
        inverse_dynamics(model, SX.zeros(1), SX.zeros(1), SX.zeros(1))


def test_bad_arguments_are_explained() -> None:
    model, x = random_model(np.random.default_rng(0), 2), SX.sym("x", 2)
    with pytest.raises(InputError, match=r"v has shape \(3, 1\), expected \(2, 1\)"):
        inverse_dynamics(model, x, SX.sym("v", 3), x)
    with pytest.raises(InputError, match=r"gravity has shape \(2, 1\)"):
        inverse_dynamics(model, x, x, x, gravity=[0.0, 1.0])
    with pytest.raises(InputError, match=r"payload.inertia has shape \(3, 1\), expected \(3, 3\)"):
        inverse_dynamics(model, x, x, x, payload=Payload(1.0, [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]))
    for joint in ("elbow", 0, 3, -1):
        with pytest.raises(RobotDefinitionError, match=rf"{joint!r} is not a joint of 'random'; joints are \['joint1'"):
            forward_kinematics(model, x, joint)
    with pytest.raises(RobotDefinitionError, match="'elbow' is not a joint"):
        inverse_dynamics(model, x, x, x, payload=Payload(1.0, [0.0, 0.0, 0.0], joint="elbow"))
    model.addJoint(2, pin.JointModelPrismaticUnaligned(np.zeros(3)), pin.SE3.Identity(), "nowhere")
    with pytest.raises(OcpTrajError, match="joint 'nowhere' has the axis"):
        inverse_dynamics(model, SX.zeros(3), SX.zeros(3), SX.zeros(3))


@pytest.mark.parametrize("order", ["casadi, pinocchio", "pinocchio, casadi"])
def test_import_order_does_not_matter(order: str) -> None:
    code = (
        f"import {order}; import pinocchio as pin; from ocp_traj.robot.dynamics import inverse_dynamics;"
        "from casadi import SX; x = SX.sym('x', 6); inverse_dynamics(pin.buildSampleModelManipulator(), x, x, x)"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True, timeout=120)
