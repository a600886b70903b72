"""What is said of two bodies at an instant, against 50 digits; and of how fast they move, against differences."""

from typing import Any

import mpmath
import numpy as np
import pytest

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.body_motion import ArcMotion, Joints, motion_bounds
from ocp_traj.proof.enclosure import Arcs
from ocp_traj.proof.separation import BodyTable, Frames, separation
from ocp_traj.robot.bodies import Body
from ocp_traj.robot.placements import placements_function
from tests.clearance_fuzz import some_body, some_motion
from tests.random_robots import random_robot
from tests.test_audit_attacked import in_60_digits


def exact_frames(function: Any, q: np.ndarray) -> list[list[Any]]:
    """Rows of 12 numbers a joint, of the tape with its constants as rounded."""
    values = in_60_digits(function, [[mpmath.mpf(float(x)) for x in q]])
    return [values[k : k + 12] for k in range(0, len(values), 12)]


def exact_core(body: Body, frame: list[Any]) -> tuple[list[Any], list[list[Any]]]:
    """Centre and axes (each a vector) in the world."""

    def turned(vector: Any) -> list[Any]:
        return [sum(frame[3 * i + j] * mpmath.mpf(float(vector[j])) for j in range(3)) for i in range(3)]

    centre = turned(body.centre)
    return [centre[i] + frame[9 + i] for i in range(3)], [turned(body.axes[:, k]) for k in range(3)]


def dot(x: Any, y: Any) -> Any:
    return sum(mpmath.mpf(float(a)) * b for a, b in zip(x, y, strict=True))


def exact_extent(body: Body, axes: list[list[Any]], normal: np.ndarray) -> Any:
    if body.kind == "half-space":
        return mpmath.mpf(0)
    x, y, z = (abs(dot(normal, axis)) * mpmath.mpf(float(h)) for axis, h in zip(axes, body.half, strict=True))
    return mpmath.sqrt(x * x + y * y) + z if body.kind == "cylinder" else x + y + z


@pytest.mark.parametrize("seed", range(12))
def test_what_floats_round_is_bounded(seed: int) -> None:
    """Cores are as far apart along the direction as is said, or a little more, by the digits of the tape."""
    rng = np.random.default_rng(seed)
    robot = random_robot(np.random.default_rng(seed), 1 + seed % 5)
    bodies = [some_body(rng, f"m{k}", int(rng.integers(1, robot.model.njoints))) for k in range(3)]
    bodies += [some_body(rng, f"o{k}", 0) for k in range(3)]
    joints = Joints.of(robot, [body.joint for body in bodies])
    table, function = BodyTable.of(bodies, joints.indices), placements_function(robot, joints.indices)
    q = rng.uniform(-3.0, 3.0, size=(robot.size, 2))
    q[:, 1] *= 30.0
    frames = Frames.of_bounds(*Tape(function).enclose((q, q))[0])
    pairs = np.array([(i, j) for i in range(3) for j in range(3, 6)])
    with mpmath.workdps(50):
        for instant in range(2):
            frame = exact_frames(function, q[:, instant])
            found = separation(table, frames, np.full(len(pairs), instant), *pairs.T)
            for (i, j), normal, apart in zip(pairs.tolist(), found.normal, found.apart, strict=True):
                assert mpmath.sqrt(dot(normal, [mpmath.mpf(float(x)) for x in normal])) <= 1
                (c, axes), (d, others) = (exact_core(bodies[k], frame[table.joint[k]]) for k in (i, j))
                between = [x - y for x, y in zip(c, d, strict=True)]
                exact = dot(normal, between) - exact_extent(bodies[i], axes, normal)
                exact -= exact_extent(bodies[j], others, normal)
                assert apart <= exact <= apart + 1e-11, (bodies[i].kind, bodies[j].kind)


@pytest.mark.parametrize("seed", range(12))
def test_no_point_of_a_body_moves_faster_than_is_said(seed: int) -> None:
    """Nor turns away faster, seen from any joint below: differences of its points at many instants of each arc."""
    rng = np.random.default_rng(seed)
    robot = random_robot(np.random.default_rng(seed), 2 + seed % 4)
    bodies = [some_body(rng, f"m{k}", robot.model.njoints - 1) for k in range(4)]
    joints = Joints.of(robot, [body.joint for body in bodies])
    table, tape = BodyTable.of(bodies, joints.indices), Tape(placements_function(robot, joints.indices))
    curve: PiecewiseBezier = some_motion(rng, robot).curve
    points = curve.control_points[0]
    arcs = Arcs.of_segments(*np.zeros((2, 1), dtype=np.intp), points[None], curve.durations[:1], 2)
    for _ in range(int(rng.integers(0, 5))):
        left, right = arcs.split(np.full(len(arcs), 0.5))
        arcs = left.interleave(right)
    ends = [Frames.of_bounds(*tape.enclose(arcs.end(0, which))[0]) for which in (0, -1)]
    rates = [np.maximum(-low, high) for low, high in (arcs.hull(1), arcs.hull(2))]
    moved = ArcMotion(ends[0], ends[1], arcs.width(), *rates)
    for base in range(len(joints.indices) - 1):
        arc, body = (part.ravel() for part in np.indices((len(arcs), len(bodies))))
        speed, acceleration = motion_bounds(joints, table, moved, arc, body, np.full(len(arc), base))
        for k, (a, i) in enumerate(zip(arc.tolist(), body.tolist(), strict=True)):
            u = np.linspace(arcs.a[a], arcs.b[a], 41)
            step = float(curve.durations[0]) * (u[1] - u[0])
            path = tracks(tape.evaluate(curve.at(0, u).T)[0], bodies[i], base, len(joints.indices) - 1)
            velocity = np.linalg.norm(np.diff(path, axis=0), axis=2) / step
            bend = np.linalg.norm(np.diff(path, n=2, axis=0), axis=2) / step**2
            assert velocity.max() <= speed[k] * (1.0 + 1e-9) + 1e-9
            assert bend.max() <= acceleration[k] * (1.0 + 1e-6) + 1e-13 / step**2


def tracks(values: np.ndarray, body: Body, base: int, joint: int) -> np.ndarray:
    """Points of a core seen from a joint, ``(N, points, 3)``; of a cylinder those of its axis, which do not turn."""
    frames = values.reshape(-1, 12, values.shape[-1])
    low, high = (frames[k, :9].T.reshape(-1, 3, 3) for k in (base, joint))
    place = (frames[joint, 9:] - frames[base, 9:]).T
    if body.kind == "cylinder":
        points = body.centre + np.array([[-1.0], [1.0]]) * body.half[2] * body.normal
    else:
        points = body.vertices
    return np.einsum("nji,npj->npi", low, np.einsum("nij,pj->npi", high, points) + place[:, None])
