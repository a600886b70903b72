"""The start of ``weld-bezier``: the arm fitted along a seam, or the tag and the reason why it cannot be."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.curves.families import at_rest, nonic
from ocp_traj.errors import InputError
from ocp_traj.paths.pieces import Pieces, pieces
from ocp_traj.paths.seam import Seam
from ocp_traj.paths.tracking import Fit, fit_path, perpendicular, pose_function
from ocp_traj.problems import kr90
from ocp_traj.robot.robot import Robot

Case = Any  # the paper's, which is built on this file: no import can name it

JOINTS = kr90.JOINTS
SINGULAR = 1e-2  # least singular value of a tag's Jacobian (place [m] and torch's axis); our choice
CLOSE = 1e-4  # [m], and
STEEP = radians(1.0)  # [rad] of tilt: a fit that is farther off has not reached the seam; our choice


@dataclass(frozen=True)
class Start:
    """From where a seam is optimised.

    Attributes:
        cut: the seam in pieces.
        fit: the arm along it.
        air: durations of approach and retract that the limits allow [s].
    """

    cut: Pieces
    fit: Fit
    air: tuple[float, float]


@one_blas_thread
def find_start(machine: Robot, path: Seam, case: Case) -> Start:
    """The seam in pieces, the arm fitted to it from home and from home's other wrist postures, the quickest of them.

    Raises ``InputError``, with the worst tag and the reason, where no posture follows the seam.
    """
    cut = pieces(path, case.tags)
    for name, error in (("tcp_box", case.tcp_box), ("tcp_tolerance", case.tcp_tolerance)):
        if cut.position_error > 0.1 * error:
            raise InputError(
                f"between {case.tags} tags the seam is written to {1e3 * cut.position_error:.2g} mm only, and {name} "
                f"is {1e3 * error:g} mm; give more tags, or a wider {name}"
            )
    if not cut.axis_error < 1.0 - cos(radians(case.max_tilt)):
        raise InputError(
            f"between {case.tags} tags the torch's direction is written to {cut.axis_error:.2g} of a unit vector only, "
            f"more than max_tilt {case.max_tilt:g} deg leaves; give more tags, or a wider max_tilt"
        )
    home = np.radians(case.home)
    weld = path.length / case.weld_speed / (case.tags - 1)
    reached, failed = [], []
    for posture in _postures(home):
        fit = fit_path(machine, cut, posture)
        problem = _obstruction(machine, cut, fit, case)
        if problem:
            failed.append((problem, float(fit.place_error.max())))
            continue
        tags = fit.states / weld ** np.arange(5)[:, None]
        rest = at_rest(home)
        air = least_time(rest, tags[0], case), least_time(tags[-1], rest, case)
        reached.append(Start(cut, fit, air))
    if not reached:
        raise InputError(min(failed, key=lambda f: f[1])[0])
    return min(reached, key=lambda s: sum(s.air))


def least_time(start: Array, end: Array, case: Case) -> float:
    """Least duration [s] of a nonic between two states ``(5, 6)``, to 2 %, at which the limits up to snap hold."""
    limits = [np.radians(v) for v in (kr90.VELOCITY, kr90.ACCELERATION, kr90.JERK, kr90.SNAP)]
    for duration in np.geomspace(case.min_air_time, case.max_air_time, 200):
        curve = nonic([start, end], np.array([duration]))
        if all(
            max(-extreme.lower, extreme.upper) <= bound
            for order, bounds in enumerate(limits, 1)
            for extreme, bound in zip(curve.extrema(order), bounds, strict=True)
        ):
            return float(duration)
    return float(case.max_air_time)


def _obstruction(machine: Robot, cut: Pieces, fit: Fit, case: Case) -> str:
    """Why a fit does not follow the seam, by its worst tag; empty where it does."""
    pose = pose_function(machine)
    low, high = np.radians(kr90.POSITION)
    worst = int(np.argmax(np.maximum(fit.place_error / CLOSE, fit.tilt / STEEP)))
    name = f"tag {worst + 1} of {len(cut.tags)}"
    if fit.place_error[worst] > CLOSE or fit.tilt[worst] > STEEP:
        k, u = (worst, 0.0) if worst < len(cut.position) else (worst - 1, 1.0)
        place, axis = (values[0] for values in cut.values(k, u))
        away = _wrist_distance(place, axis, case)
        if away > kr90.REACH:
            return (
                f"{name} is out of reach: however the torch is turned about its axis, the wrist's centre is "
                f"{away:.3f} m from A2 or more, and the arm is {kr90.REACH:.3f} m long; move the seam or the robot"
            )
        return (
            f"{name} cannot be reached with the torch along the seam: the best fit is "
            f"{1e3 * fit.place_error[worst]:.3g} mm and {np.degrees(fit.tilt[worst]):.3g} deg off; move the seam or "
            "the robot, or change home"
        )
    q = fit.states[:, 0]
    over = np.maximum(q - high, low - q)
    if over.max() > 0.0:
        tag, joint = np.unravel_index(int(np.argmax(over)), over.shape)
        return (
            f"tag {tag + 1} of {len(cut.tags)} asks for {JOINTS[joint]} at {np.degrees(q[tag, joint]):.1f} deg, its "
            f"range is {np.degrees(low[joint]):g} to {np.degrees(high[joint]):g} deg; move the seam or change home"
        )
    values = []
    for posture in q:  # of five directions: the torch may spin
        _, axis, jp, jz = (np.array(o) for o in pose(posture))
        across = perpendicular(axis.ravel()) @ jz
        values.append(np.linalg.svd(np.concatenate([jp, across]), compute_uv=False)[-1])
    if min(values) < SINGULAR:
        least = int(np.argmin(values))
        return (
            f"tag {least + 1} of {len(cut.tags)} is singular: the smallest singular value of its Jacobian is "
            f"{values[least]:.2g}, {SINGULAR:g} or more is needed; move the seam or change home"
        )
    return ""


def _wrist_distance(place: Array, axis: Array, case: Case) -> float:
    """Least distance of the wrist's centre from A2 [m] over all spins of a torch at a place, along an axis."""
    side = perpendicular(axis / np.linalg.norm(axis))
    best = np.inf
    for spin in np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False):
        x = np.cos(spin) * side[0] + np.sin(spin) * side[1]
        rotation = np.stack([x, np.cross(axis, x), axis], axis=1)
        wrist = place + rotation @ kr90.wrist_from_tip()
        out = np.hypot(wrist[0], wrist[1]) - kr90.ARM.a1
        best = min(best, float(np.hypot(out, wrist[2] - case.riser - kr90.ARM.d1)))
    return best


def _postures(home: Array) -> list[Array]:
    """Home, and the same pose with the wrist turned over, as far as the joints' ranges allow."""
    low, high = np.radians(kr90.POSITION)
    found = [home]
    for fourth in (np.pi, -np.pi):
        for sixth in (np.pi, -np.pi):
            over = home * np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0]) + np.array([0.0, 0.0, 0.0, fourth, 0.0, sixth])
            found.append(over)
    return [posture for posture in found if ((posture > low) & (posture < high)).all()]
