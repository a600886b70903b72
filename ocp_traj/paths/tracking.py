"""Fits a joint curve of nonic segments to the path of a torch: the start from which a seam can be optimised.

One Levenberg-Marquardt fit of all tags' (q, v, a, jerk, snap) at once; the torch may spin about its axis, so a little
of dq/du and of snap makes the answer definite. Without it a local solver fails, and random starts wind up the wrist.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier, basis, difference_matrix
from ocp_traj.curves.families import nonic
from ocp_traj.paths.pieces import Pieces
from ocp_traj.paths.seam import Seam
from ocp_traj.robot.robot import Robot

SAMPLES = 7  # of the path a piece; our choice, as all that follow
# Units of the residuals, each of weight one. The last two regularise the torch's spin: large, so that they hardly move
# place and tilt.
PLACE = 1e-3  # [m] error of the tool's place
TILT = 0.05  # [rad] angle between torch and axis
RATE = 5.0  # [rad] dq/du
SNAP = 500.0  # [rad] d4q/du4
# Factors on the units of place and tilt, one fit each: a continuation from a regularised fit, which keeps the posture
# of the start, to the wanted one.
STAGES = (300.0, 30.0, 1.0)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted motion along a seam.

    Attributes:
        states: (q, v, a, jerk, snap) at the tags, in local time u: ``(K + 1, 5, dof)`` [rad a piece^k].
        place_error: largest distance found at the samples, by tag ``(K + 1,)`` [m].
        tilt: largest angle between torch and axis there ``(K + 1,)`` [rad].
    """

    states: Array
    place_error: Array
    tilt: Array


def pose_function(robot: Robot) -> casadi.Function:
    """Casadi Function q -> place ``(3,)`` [m] and axis z ``(3,)`` of the tool, and their Jacobians ``(3, dof)``."""
    q = casadi.SX.sym("q", robot.size)
    rotation, place = robot.tool_pose(q)
    axis = rotation[:, 2]
    outputs = [place, axis, casadi.jacobian(place, q), casadi.jacobian(axis, q)]
    return casadi.Function("pose", [q], [casadi.densify(o) for o in outputs])


def fit_path(robot: Robot, pieces: Pieces, start: Sequence[float] | Array, iterations: int = 200) -> Fit:
    """Fits tags to a seam from one posture ``(dof,)`` at all of them.

    Args:
        robot: whose tool has its torch's axis along z.
        pieces: of the seam.
        start: posture.
        iterations: of the least-squares solver, at most.
    """
    count, dof = len(pieces.tags), robot.size
    u = np.linspace(0.0, 1.0, SAMPLES)
    # Control points of one piece from the 10 rows of its two tags: the curve of unit states.
    matrix = np.zeros((10, 10))
    for i in range(10):
        rows = np.zeros((2, 5, 1))
        rows[i // 5, i % 5] = 1.0
        matrix[:, i] = nonic(list(rows), np.ones(1)).control_points[0][:, 0]
    values = basis(9, u) @ matrix  # (samples, 10)
    slopes = basis(8, u) @ difference_matrix(9, 1) @ matrix
    snaps = basis(5, u) @ difference_matrix(9, 4) @ matrix
    targets = [pieces.values(k, u) for k in range(count - 1)]
    place = np.concatenate([t[0] for t in targets])
    axis = np.concatenate([t[1] for t in targets])
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    side = np.stack([perpendicular(a) for a in axis])  # (N, 2, 3)
    function = pose_function(robot)
    total = (count - 1) * SAMPLES
    pose = function.map(total)

    def spread(part: Array) -> Array:
        """Rows ``(N, 5 count)`` of all samples in terms of all tags."""
        rows = np.zeros((total, 5 * count))
        for k in range(count - 1):
            rows[k * SAMPLES : (k + 1) * SAMPLES, 5 * k : 5 * k + 10] = part
        return rows

    positions, rates, fourths = spread(values), spread(slopes), spread(snaps)
    smooth = np.concatenate([np.kron(rates, np.eye(dof)) / RATE, np.kron(fourths, np.eye(dof)) / SNAP])

    def evaluate(x: Array) -> tuple[Array, ...]:
        q = positions @ x.reshape(5 * count, dof)
        p, z, jp, jz = (np.array(o) for o in pose(q.T))
        return p.T, z.T, jp.reshape(3, total, dof).swapaxes(0, 1), jz.reshape(3, total, dof).swapaxes(0, 1)

    def residuals(softness: float, x: Array) -> Array:
        p, z, _, _ = evaluate(x)
        tilt = np.einsum("nij,nj->ni", side, z) / TILT
        backwards = np.minimum(np.einsum("nj,nj->n", axis, z), 0.0) / TILT  # a torch that points the other way
        aim = np.concatenate([((p - place) / PLACE).ravel(), tilt.ravel(), backwards])
        return np.concatenate([aim / softness, smooth @ x])

    def jacobian(softness: float, x: Array) -> Array:
        _, z, jp, jz = evaluate(x)
        tilt = np.einsum("nij,njk->nik", side, jz) / TILT
        behind = np.einsum("nj,nj->n", axis, z) < 0.0
        backwards = np.einsum("nj,njk->nk", axis, jz)[:, None] / TILT * behind[:, None, None]
        parts = []
        for block in (jp / PLACE, tilt, backwards):
            spread_out = block[:, :, None, :] * positions[:, None, :, None]
            parts.append(spread_out.reshape(-1, 5 * count * dof) / softness)
        return np.concatenate([*parts, smooth])

    first = np.zeros((count, 5, dof))
    first[:, 0] = start
    x = first.ravel()
    for softness in STAGES:
        x = _levenberg_marquardt(partial(residuals, softness), partial(jacobian, softness), x, iterations)
    p, z, _, _ = evaluate(x)
    distance = np.linalg.norm(p - place, axis=1).reshape(-1, SAMPLES)
    angle = np.arccos(np.clip((axis * z).sum(axis=1), -1.0, 1.0)).reshape(-1, SAMPLES)
    return Fit(x.reshape(count, 5, dof), _by_tag(distance), _by_tag(angle))


def figures(
    robot: Robot, seam: Seam, tags: Array, curve: PiecewiseBezier, first: int, samples: int = 100
) -> list[tuple[str, float, str]]:
    """How closely a torch keeps to a seam itself, not to its polynomials: (name, value, unit) of each figure.

    Args:
        robot: whose tool has its torch's axis along z.
        seam: what is welded.
        tags: lengths of arc at the ends of its pieces ``(K + 1,)`` [m].
        curve: of the joints.
        first: segment of the curve on which the first piece lies; the others follow.
        samples: a piece.
    """
    u, segments = np.linspace(0.0, 1.0, samples), range(first, first + len(tags) - 1)
    rotation, place = robot.poses(np.concatenate([curve.at(k, u) for k in segments]))
    wanted = seam.at(np.concatenate([a + (b - a) * u for a, b in pairwise(tags)]))
    off = np.linalg.norm(place - wanted.position, axis=1)
    tilt = np.arccos(np.clip((rotation[:, :, 2] * wanted.axis).sum(axis=1), -1.0, 1.0))
    return [
        ("tip off the seam, rms", 1e3 * float(np.sqrt((off**2).mean())), "mm"),
        ("tip off the seam, largest", 1e3 * float(off.max()), "mm"),
        ("tilt of the torch, largest", float(np.degrees(tilt.max())), "deg"),
        ("time of the weld", float(np.asarray(curve.durations)[list(segments)].sum()), "s"),
    ]


def _levenberg_marquardt(
    residuals: Callable[[Array], Array], jacobian: Callable[[Array], Array], x: Array, iterations: int
) -> Array:
    """Marquardt's method on the normal equations, which are accurate enough here and ten times quicker than QR."""
    damping, r = 1e-2, residuals(x)
    for _ in range(iterations):
        j = jacobian(x)
        normal, gradient = j.T @ j, j.T @ r
        while damping < 1e8:
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), -gradient)
            tried = residuals(x + step)
            if tried @ tried < r @ r:
                break
            damping *= 4.0
        else:
            return x
        gain = 1.0 - (tried @ tried) / (r @ r)
        x, r, damping = x + step, tried, max(damping / 5.0, 1e-12)
        if gain < 1e-6:
            return x
    return x


def perpendicular(axis: Array) -> Array:
    """Two unit vectors across a unit vector, and each other ``(2, 3)``."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first)])


def _by_tag(values: Array) -> Array:
    """Largest value near each tag, of the half pieces on both sides: ``(K + 1,)`` from ``(K, samples)``."""
    half = SAMPLES // 2
    before = np.concatenate([[0.0], values[:, half:].max(axis=1)])
    after = np.concatenate([values[:, :half].max(axis=1), [0.0]])
    return np.asarray(np.maximum(before, after))
