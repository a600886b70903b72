"""A robot's joints, links and surroundings as plain data, so that a page computes where they are by itself.

Joints are those of the Pinocchio model: where each is on its parent, its axis, and whether it turns or slides. Where
actuators do not drive them one by one, the map from actuators to joints goes along as a list of scalar operations.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import casadi
import numpy as np
import pinocchio as pin

from ocp_traj.errors import UnsupportedOperation
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.surroundings import Surroundings
from ocp_traj.robot.bodies import HALF_SPACE, Body
from ocp_traj.robot.dynamics import joint_index, joint_is_revolute
from ocp_traj.robot.robot import Robot

# What the page computes, by the names it knows them by.
OPERATIONS = {
    casadi.OP_ASSIGN: "same", casadi.OP_ADD: "add", casadi.OP_SUB: "sub", casadi.OP_MUL: "mul", casadi.OP_DIV: "div",
    casadi.OP_NEG: "neg", casadi.OP_EXP: "exp", casadi.OP_LOG: "log", casadi.OP_POW: "pow", casadi.OP_CONSTPOW: "pow",
    casadi.OP_SQRT: "sqrt", casadi.OP_SQ: "sq", casadi.OP_TWICE: "twice", casadi.OP_INV: "inv", casadi.OP_SIN: "sin",
    casadi.OP_COS: "cos", casadi.OP_TAN: "tan", casadi.OP_ASIN: "asin", casadi.OP_ACOS: "acos", casadi.OP_ATAN: "atan",
    casadi.OP_ATAN2: "atan2", casadi.OP_TANH: "tanh",
}  # fmt: skip
NO_ROBOT = "The problem names no robot, so none is drawn."
OTHER_JOINTS = "The robot has other joints than the trajectory, so it is not drawn."


def robot_data(problem: Problem) -> dict[str, Any]:
    """What is drawn in space of a problem's robot, or why nothing is: ``{"absent": words}``."""
    robot = problem.robot
    if not isinstance(robot, Robot):
        return {"absent": NO_ROBOT}
    if robot.size != problem.requirements.dof:
        return {"absent": OTHER_JOINTS}
    try:
        actuators = None if robot.actuator_map is None else actuator_steps(robot)
    except UnsupportedOperation as error:
        return {"absent": f"The robot is not drawn: {error}."}
    around = problem.about.surroundings() if problem.about.surroundings is not None else Surroundings()
    limited = [body for limit in problem.requirements.clearance_constraints for body in limit.bodies]
    bodies = {body.name: body for body in (*limited, *around.bodies)}
    return {
        "joints": [_joint(robot.model, index) for index in range(1, robot.model.njoints)],
        "tool": {"joint": joint_index(robot.model, robot.tool_joint), "placement": _placement(robot.tool)},
        "actuators": actuators,
        "up": _up(robot.model),
        "bodies": [_body(body) for body in bodies.values()],
        "paths": [{"name": name, "points": points.tolist()} for name, points in around.paths.items()],
    }


def actuator_steps(robot: Robot) -> dict[str, Any]:
    """The map from actuators ``(n,)`` to joints ``(nv,)`` as steps on registers.

    A step is ``[name, written, read..]``; ``const`` reads a number, ``in`` an actuator, ``out`` writes a joint.

    Raises:
        UnsupportedOperation: where it has an operation that the page does not know.
    """
    assert robot.actuator_map is not None
    q = casadi.SX.sym("q", robot.size)
    function = casadi.Function("joints", [q], [casadi.densify(robot.actuator_map.position(q))])
    steps: list[list[Any]] = []
    for index in range(function.n_instructions()):
        operation = function.instruction_id(index)
        read, written = function.instruction_input(index), function.instruction_output(index)
        if operation == casadi.OP_CONST:
            steps.append(["const", written[0], function.instruction_constant(index)])
        elif operation == casadi.OP_INPUT:
            steps.append(["in", written[0], read[1]])
        elif operation == casadi.OP_OUTPUT:
            steps.append(["out", written[1], read[0]])
        elif operation in OPERATIONS:
            steps.append([OPERATIONS[operation], written[0], *read])
        else:
            raise UnsupportedOperation(
                f"its map {robot.actuator_map.name!r} from actuators to joints has an operation (number {operation}) "
                "that the page cannot compute"
            )
    return {"steps": steps, "registers": function.sz_w(), "size": robot.model.nv}


def _joint(model: pin.Model, index: int) -> dict[str, Any]:
    turns = joint_is_revolute(model, index)
    subspace = np.asarray(model.createData().joints[index].S, dtype=float).reshape(6)
    return {
        "name": str(model.names[index]),
        "parent": int(model.parents[index]),
        "column": int(model.joints[index].idx_v),
        "turns": turns,
        "axis": (subspace[3:] if turns else subspace[:3]).tolist(),
        "placement": _placement(model.jointPlacements[index]),
    }


def _placement(frame: pin.SE3) -> list[float]:
    """Rotation, row by row, then position [m]: 12 numbers."""
    return [*np.asarray(frame.rotation, dtype=float).ravel().tolist(), *np.asarray(frame.translation).tolist()]


def _up(model: pin.Model) -> list[float]:
    """Against gravity; along z where there is none."""
    gravity = np.asarray(model.gravity.linear, dtype=float)
    size = float(np.linalg.norm(gravity))
    return [0.0, 0.0, 1.0] if size == 0.0 else (-gravity / size).tolist()


def _body(body: Body) -> dict[str, Any]:
    half: Iterable[float] = np.zeros(3) if body.kind == HALF_SPACE else body.half
    return {
        "name": body.name, "kind": body.kind, "joint": body.joint, "radius": body.radius,
        "centre": body.centre.tolist(), "axes": body.axes.ravel().tolist(), "half": [float(h) for h in half],
    }  # fmt: skip
