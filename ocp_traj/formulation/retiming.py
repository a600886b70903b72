"""Motions along a path whose geometry is kept: q(s(t)), with the time law as the decision variables.

The composition of two polynomials is a polynomial, so that a retimed path is solved and proved like any other curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np

from ocp_traj.errors import InputError, ProblemDefinitionError, quoted
from ocp_traj.formulation.parametrisation import Parametrisation
from ocp_traj.formulation.requirements import PathConstraint, State
from ocp_traj.formulation.time_law import TimeLaw
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.robot.joint_limits import QUANTITIES, JointLimits

HIGHEST_DEGREE = 60  # of a segment: of higher ones rounding leaves nothing; our choice, as of files
BACK = 1e-6  # [units of the joints a second] by which a motion may run back along its path: our choice
FORWARD = "forward"  # id of the limit that keeps it from doing so


def retiming(
    path: JointPath, limits: JointLimits, *, pieces: int = 8, rest: int = 1, units: Sequence[str] = ("rad",)
) -> Parametrisation:
    """A motion along a path; durations and derivatives of the time law at knots are variables.

    Knots cut each piece of the path into equal steps of its parameter, shorter towards an end at rest. The law is of C1
    cubics where velocity and acceleration are limited, of C2 quintics where jerk is or where the joints begin and end
    without acceleration, of C3 septics where snap is.

    Args:
        path: its geometry is kept.
        limits: of the joints.
        pieces: segments from one point of the path to the next.
        rest: derivatives of the joints that vanish at both ends, 0 to 3.
        units: of the joints, "rad" or "m".

    Raises:
        InputError: names the limit that the path itself breaks, or that no law can keep on it.
    """
    if not 0 <= rest <= 3:
        raise ProblemDefinitionError(f"rest: {rest}; give 0 to 3, the derivatives that vanish at the ends")
    if pieces < 1:
        raise ProblemDefinitionError(f"pieces: {pieces}; give 1 or more")
    if limits.size not in (None, len(path.joints)):
        raise ProblemDefinitionError(f"limits of {limits.size} joints; the path has {len(path.joints)}")
    highest = max((m for m in range(5) if np.isfinite(np.array(limits.bounds(m) or np.inf)).any()), default=0)
    _check_smooth(path, highest)
    _check_positions(path, limits)
    law = TimeLaw(path, limits, max(2, highest, rest + 1), pieces, rest)
    degree = max(path.curve.degrees) * (2 * law.rows - 1)
    if degree > HIGHEST_DEGREE:
        raise InputError(
            f"a path of degree {max(path.curve.degrees)} with a time law of degree {2 * law.rows - 1} makes segments "
            f"of degree {degree}; allowed are {HIGHEST_DEGREE}: give its points instead, which cubics go through, or "
            "leave out the highest limit"
        )
    return _parametrisation(law, " or ".join(f"{unit}/s" for unit in dict.fromkeys(units)))


def _parametrisation(law: TimeLaw, unit: str) -> Parametrisation:
    count = law.count

    def duration(x: Any) -> Any:
        return casadi.sum1(x[:count]) if isinstance(x, casadi.SX | casadi.MX) else float(x[:count].sum())

    starts = tuple((leg.start, 0.0) for leg in law.cut.legs)
    return Parametrisation(
        variables=law.variables,
        curve=law.curve,
        guess=law.guess,
        variables_of=law.variables_of,
        dilate=law.dilate,
        knots=(*starts, (-1, 1.0)),
        legs=law.cut.legs,
        continuity=min(law.rows - 1, law.path.continuity),
        hull_rows=(1, 2, 3, 4),
        scales_in_time=False,
        duration=duration,
        limits=(forward(law, unit),),
        refine=lambda x, parts: law.refined(replace(law, pieces=law.pieces // parts), x),
    )


def forward(law: TimeLaw, unit: str = "rad/s") -> PathConstraint:
    """The limit that the motion does not run back along its path, but for ``BACK``.

    A law that ran back could leave its segment, and the motion its path. On each segment the limit is on the velocity
    along a direction in which the path itself goes on all over it, so that it has the sign of s'.
    """

    def speed(state: State) -> Any:
        return casadi.dot(state.v, state.c)

    low, high = np.array([-BACK]), np.array([np.inf])
    return PathConstraint(FORWARD, speed, low, high, (unit,), ("speed",), constants=law.cut.directions)


def _check_smooth(path: JointPath, highest: int) -> None:
    # Where the k-th derivative of the path jumps, so does that of the motion, and the next one has no bound there.
    if highest - 1 > path.continuity:
        name = QUANTITIES[highest]
        raise InputError(
            f"{name} is limited, and the path's derivatives are continuous up to the {path.continuity}. alone: at its "
            f"points every motion but a stop breaks any limit on {name}; leave that limit out, or give a smoother path "
            "(points joined by a spline of degree 5)"
        )


def _check_positions(path: JointPath, limits: JointLimits) -> None:
    pair = limits.bounds(0)
    if pair is None:
        return
    for joint, found, low, high in zip(path.joints, path.curve.extrema(0), *pair, strict=True):
        for value, at, bound, beyond in (
            (found.lower, found.lower_time, low, found.lower < low),
            (found.upper, found.upper_time, high, found.upper > high),
        ):
            if beyond:
                leg = int(path.curve.locate(at)[0][0])
                raise InputError(
                    f"between its points {leg + 1} and {leg + 2} the path takes {quoted(joint)} to {value:.6g}, beyond "
                    f"its limit {bound:.6g}; give other points"
                )
