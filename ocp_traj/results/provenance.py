"""What a trajectory says of itself, held against its problem before its limits are proved.

A file is evidence, not truth: the problem of its case decides what parameters, durations and bounds there are. The
variables of a trajectory have to give its curve and its parameters; they are found from those where it has none, such
as after a dilation. Each variable is then held to its bounds, as a row of the audit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.proof.audit import audit_all, checked_row, require_joints
from ocp_traj.proof.verdicts import VIOLATED, Audit, AuditRow
from ocp_traj.transcription.symbolic import curve_function, motion_of

AGREE = 1e-9  # by which numbers of size 1 or relatively may differ: far above what another processor rounds differently
ON_BOUND = 1e-9  # of a bound on a variable, by which rounding may take the variable past it: our choice
ROUNDING = 1e-12  # relative: variables found this close to a bound are on it; our choice
STEPS = 20  # of the search for variables; a curve is nearly linear in them where its durations are known


def audit_motions(
    problem: Problem, motions: Sequence[Motion], variables: Sequence[Mapping[str, Array]], **options: Any
) -> list[Audit]:
    """Audits motions of a problem: its limits, the bounds of its variables, and that all of it agrees.

    Args:
        problem: whose limits hold.
        motions: of its joints, in its order.
        variables: of each motion, by block; none where they are to be found from it.
        options: of ``ocp_traj.proof.audit.audit_all``.

    Raises:
        InputError: where joints, variables, parameters, case and curve of a motion do not agree to ``AGREE``.
    """
    for motion in motions:
        require_joints(motion, problem.requirements)
    more = [_rows_of_variables(problem, *pair) for pair in zip(motions, variables, strict=True)]
    found = audit_all(motions, problem.requirements, **options)
    return [replace(one, rows=(*one.rows, *rows)) for one, rows in zip(found, more, strict=True)]


def bound_rows(problem: Problem, x: Array) -> list[AuditRow]:
    """A row for each variable ``x (n,)``, held to its bounds."""
    entries = zip(
        problem.labels, problem.units, x.tolist(), problem.lower.tolist(), problem.upper.tolist(), strict=True
    )
    blocks = [v.id for v in problem.variables for _ in v.labels]
    return [checked_row(block, *entry, ON_BOUND) for block, entry in zip(blocks, entries, strict=True)]


def _rows_of_variables(problem: Problem, motion: Motion, variables: Mapping[str, Array]) -> list[AuditRow]:
    if variables:
        x = _given_variables(problem, variables)
        worst, what = disagreement(problem, motion, x)
        if worst > 1.0:
            raise InputError(
                f"the trajectory's {what} is not what its variables and its case give in {problem.id}: one of them was "
                "changed; correct that one"
            )
        return bound_rows(problem, x)
    x = recovered_variables(problem, motion)
    worst, what = disagreement(problem, motion, x)
    if worst <= 1.0:
        return bound_rows(problem, x)
    row = checked_row("variables", f"that give the {what}", "-", worst * AGREE, 0.0, AGREE, ON_BOUND)
    return [replace(row, verdict=VIOLATED)]


def _given_variables(problem: Problem, variables: Mapping[str, Array]) -> Array:
    """The decision vector that a trajectory brings along, block by block."""
    wanted = {v.id: len(v.labels) for v in problem.variables}
    given = {name: np.size(block) for name, block in variables.items()}
    if given != wanted:
        raise InputError(f"the trajectory has the variables {given}; {problem.id} has {wanted} in this case")
    x = np.concatenate([np.ravel(variables[name]) for name in wanted])
    if not np.isfinite(x).all():
        raise InputError(f"the trajectory's variables have to be finite numbers in {problem.id}")
    return x


def recovered_variables(problem: Problem, motion: Motion) -> Array:
    """Variables ``(n,)`` that come as close as can be to a trajectory's durations, control points and parameters.

    By Gauss and Newton's method from a guess of the problem's.
    """
    curve = curve_function(problem)
    wanted = _numbers(motion, problem)
    x = np.asarray(problem.guess(np.random.default_rng(0)), dtype=float)
    if len(wanted) != sum(curve.numel_out(i) for i in range(curve.n_out())):
        return x  # of another number of segments or another degree: nothing comes close
    slopes = problem.cached("slopes of the curve", lambda: _slopes(curve))
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            residual = wanted - np.concatenate([np.array(value).ravel(order="F") for value in curve(x)])
            matrix = np.array(slopes(x))
            if not (np.isfinite(residual).all() and np.isfinite(matrix).all()):
                return x
            step = np.linalg.lstsq(matrix, residual, rcond=1e-13)[0]
            x = x + step
            if np.abs(step).max(initial=0.0) <= 1e-15 * (1.0 + np.abs(x).max(initial=0.0)):
                break
    for bound in (problem.lower, problem.upper):
        x = np.where(np.abs(x - bound) <= ROUNDING * (1.0 + np.abs(bound)), bound, x)
    return x


def _slopes(curve: Any) -> Any:
    """Casadi Function x -> Jacobian of all outputs of a curve, stacked by columns."""
    x = casadi.SX.sym("x", curve.numel_in(0))
    stacked = casadi.vertcat(*map(casadi.vec, curve(x)))
    return casadi.Function("slopes", [x], [casadi.densify(casadi.jacobian(stacked, x))])


def _numbers(motion: Motion, problem: Problem) -> Array:
    """A trajectory's durations, parameters and control points in the order of ``curve_function``."""
    parameters = problem.requirements.parameters_of([motion]).ravel()
    points = [p.ravel(order="F") for p in motion.curve.control_points]
    return np.concatenate([motion.curve.durations, parameters, *points])


def disagreement(problem: Problem, motion: Motion, x: Array) -> tuple[float, str]:
    """The largest difference between a trajectory and what ``x`` gives, over what may be, and of what it is."""
    made = motion_of(problem, x)
    pairs: list[tuple[str, Array, Array]] = [
        (f"parameter {name}, {a:.9g} against {b:.9g},", np.array(a), np.array(b))
        for name in problem.requirements.parameters
        for a, b in [(motion.parameters[name], made.parameters[name])]
    ]
    mine, theirs = motion.curve, made.curve
    if mine.degrees != theirs.degrees:
        return np.inf, "degree or number of segments"
    pairs.append(("duration of a segment", mine.durations, theirs.durations))
    pairs += [
        (f"curve on segment {k}", a, b)
        for k, (a, b) in enumerate(zip(mine.control_points, theirs.control_points, strict=True))
    ]
    worst, what = 0.0, ""
    for name, a, b in pairs:
        with np.errstate(invalid="ignore", over="ignore"):
            apart = float((np.abs(a - b) / (AGREE * (1.0 + np.abs(b)))).max())
        if not apart <= worst:  # NaN is no agreement
            worst, what = (apart if np.isfinite(apart) else np.inf), name
    return worst, what
