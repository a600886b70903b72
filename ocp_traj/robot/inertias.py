"""Moments of inertia as plain numbers, joints that move nothing with inertia, and what rounding of masses does."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import RobotDefinitionError, quoted
from ocp_traj.robot.dynamics import ROUND_OFF

ROUNDED = 1e-9  # of the least effort: our choice, far below what masses are known to
NEGLIGIBLE = 1e-14  # of the largest inertia felt at a joint: rounding of what is zero, our choice
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")  # a URDF's order


def inertia_matrix(value: Any) -> Array:
    """Moments of inertia ``(3, 3)``, symmetric and positive semidefinite [kg m^2].

    Args:
        value: ``(3, 3)``, three principal moments, or ixx, ixy, ixz, iyy, iyz, izz.
    """
    try:
        given = np.array(value, dtype=float)
    except (TypeError, ValueError):
        given = np.array(np.nan)
    if given.shape not in ((3,), (6,), (3, 3)) or not np.isfinite(given).all():
        raise RobotDefinitionError(
            f"an inertia is {quoted(value)}, expected finite numbers [kg m^2]: three principal moments, "
            f"{', '.join(MOMENTS)}, or (3, 3)"
        )
    if given.shape == (6,):
        matrix = np.empty((3, 3))
        matrix[np.triu_indices(3)] = matrix.T[np.triu_indices(3)] = given
    else:
        matrix = np.diag(given) if given.shape == (3,) else given
    scale = 1e-9 * np.abs(matrix).max()  # [kg m^2], slack for rounded data: our choice
    if np.abs(matrix - matrix.T).max() > scale or np.linalg.eigvalsh(matrix).min() < -scale:
        raise RobotDefinitionError(f"inertia {matrix.tolist()} is not symmetric and positive semidefinite")
    return np.asarray((matrix + matrix.T) / 2.0)


def missing_inertias(model: pin.Model) -> tuple[str, ...]:
    """Names of joints that feel no inertia of what they move, whose effort would be zero whatever the motion.

    A massless link between others is none: what counts is all that moves with the joint, armature included.
    """
    weightless = model.copy()
    weightless.gravity = pin.Motion.Zero()
    data = weightless.createData()
    q = 0.7 * np.arange(1.0, model.nq + 1.0)  # any posture that is not aligned by chance
    felt = np.array(
        [pin.rnea(weightless, data, q, np.zeros(model.nv), unit)[i] for i, unit in enumerate(np.eye(model.nv))]
    )
    return tuple(model.names[int(i) + 1] for i in np.flatnonzero(felt <= NEGLIGIBLE * felt.max()))


def require_inertias(model: pin.Model, wanted: str) -> None:
    """Refuses by name what needs efforts, such as "a limit on effort", of a model with inertias missing."""
    if missing := missing_inertias(model):
        raise RobotDefinitionError(
            f"{wanted} needs inertias, and nothing with inertia moves with {', '.join(map(repr, missing))}: "
            "give the links beyond a mass, com and inertia, or lock the joint"
        )


def require_exact(model: pin.Model, held_at: Array, mass: float, efforts: npt.ArrayLike, wanted: str) -> None:
    """Refuses masses for which rounding of the dynamics' constants is more than ``ROUNDED`` of the least effort.

    Args:
        model: of `effort_rounding`.
        held_at: of `effort_rounding`.
        mass: of `effort_rounding`.
        efforts: bounds, of any shape [N or N m]; those that are zero or infinite do not count.
        wanted: what is refused, for the message.
    """
    bounds, rounding = np.abs(np.asarray(efforts, dtype=float)), effort_rounding(model, held_at, mass)
    least = float(bounds[np.isfinite(bounds) & (bounds != 0.0)].min(initial=np.inf))
    if not rounding <= ROUNDED * least:
        total = mass + sum(body.mass for body in model.inertias)
        raise RobotDefinitionError(
            f"{wanted} cannot be proved for masses of {total:.6g} kg in all: rounding of the dynamics, {rounding:.3g}, "
            f"is more than {ROUNDED:g} of the least effort, {least:.6g}; check the masses"
        )


def effort_rounding(model: pin.Model, held_at: Array, mass: float) -> float:
    """What rounding of the dynamics' constants may change an effort by [N or N m], for motions of some m/s^2.

    `ocp_traj.robot.dynamics` drops what is below ``ROUND_OFF`` of a link's largest moment of mass.

    Args:
        model: with its gravity.
        held_at: ``(3,)``, the payload's place in the last joint's frame [m].
        mass: of the payload [kg].
    """
    total = mass + sum(body.mass for body in model.inertias)
    lengths = [*(place.translation for place in model.jointPlacements), held_at]
    reach = 1.0 + float(np.linalg.norm(lengths, axis=1).sum())
    return float(ROUND_OFF * total * (1.0 + np.linalg.norm(model.gravity.linear)) * reach)
