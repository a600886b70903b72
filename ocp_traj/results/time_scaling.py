"""Time scaling: a trajectory slowed down, or sped up, along its own path.

A rest-to-rest trajectory dilated by s keeps its path; its m-th derivatives fall as s^-m. Position limits and gravity do
not scale, so a near miss is mended where it is of velocity, acceleration, jerk or the dynamic part of efforts. Peaks of
derivatives are found by roots, so the least s that keeps every limit on them is known exactly,
s = max_m (peak_m / bound_m)^(1/m).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import difference_matrix, turning_values
from ocp_traj.errors import InputError
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint, Requirements
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.trajectory import audit_points
from ocp_traj.transcription.symbolic import curve_function

# Of the excess e, as the factor's distance from 1: a limit on the m-th derivative needs (1 + e)^(1/m) - 1 < e / m.
MULTIPLES = (0.2500003, 0.3333337, 0.5000005, 1.000001, 1.001, 1.1, 2.0, 10.0, 100.0)
LARGEST = 1.1  # factor: our choice; more than a tenth slower is another trajectory, not a mended one

ROOM = 1e-9  # by which s is larger, so that rounding breaks no limit; our choice


def slow_down(
    problem: Problem, xs: Sequence[Array], audits: Sequence[Audit] | None = None
) -> tuple[list[Array], list[Audit]]:
    """Dilates the unproved of several decision vectors until they are proved, at most by a factor of ``LARGEST``.

    The factors tried follow from the largest relative excess that the audit found; all vectors are audited together.

    Args:
        problem: it must say how x dilates, or nothing is changed.
        xs: decision vectors ``(n,)``.
        audits: of these vectors, where they are known.

    Returns:
        The vectors, mended where that was possible, and their audits.
    """
    xs = [np.asarray(x, dtype=float) for x in xs]
    checked = list(audits or (found for _, found in audit_points(problem, xs)))
    if problem.dilate is None:
        return xs, checked
    excess = {i: max(largest_excess(problem, found), 1e-9) for i, found in enumerate(checked) if not found.proved}
    original = list(xs)
    for multiple in MULTIPLES:
        trial = {i: np.asarray(problem.dilate(original[i], 1.0 + multiple * e)) for i, e in excess.items()}
        trial = {i: x for i, x in trial.items() if multiple * excess[i] <= LARGEST - 1.0 and (x <= problem.upper).all()}
        audited = audit_points(problem, list(trial.values()))
        for i, (_, found) in zip(trial, audited, strict=True):
            if found.proved:
                xs[i], checked[i] = trial[i], found
                del excess[i]
    return xs, checked


def largest_excess(problem: Problem, checked: Audit) -> float:
    """Largest relative amount by which a path limit is broken, at the instants the audit found."""
    return excess_over(problem.requirements, checked)


def excess_over(requirements: Requirements, checked: Audit) -> float:
    """``largest_excess``, of limits that no problem stands for."""
    limits: list[PathConstraint | ClearanceConstraint] = [
        *requirements.path_constraints, *requirements.clearance_constraints,
    ]  # fmt: skip
    scale = {
        (limit.id, label): float(size)
        for limit in limits
        for label, size in zip(limit.labels, limit.scale, strict=True)
    }
    rows = [row for row in checked.failures if (row.limit, row.label) in scale]
    return max((abs(row.attained - row.bound) / scale[row.limit, row.label] for row in rows), default=0.0)


class TimeScaling:
    """The scaling of one problem's individuals.

    Args:
        problem: it must say how x dilates.
    """

    def __init__(self, problem: Problem) -> None:
        """Compiles the curve; see the class."""
        if problem.dilate is None:
            raise InputError(f"{problem.id} does not say how its variables scale in time; leave the scaling out")
        self.problem, self.dilate = problem, problem.dilate
        curve = curve_function(problem)
        self._tape = Tape(curve)
        self._shapes = [curve.size_out(k) for k in range(2, curve.n_out())]

    def factors(self, x: Array) -> Array:
        """The least s ``(N,)`` by which each of ``x (N, n)`` keeps its limits on derivatives; 0 where none matters."""
        durations, _, *flat = self._tape.evaluate(x.T)
        least = np.zeros(len(x))
        for limit in self.problem.requirements.path_constraints:
            if not limit.order:
                continue
            for k, (values, (rows, dof)) in enumerate(zip(flat, self._shapes, strict=True)):
                points = np.swapaxes(values.reshape(dof, rows, -1), 0, 1).reshape(rows, -1)
                hodograph = difference_matrix(rows - 1, limit.order) @ points
                found = turning_values(hodograph)[1]
                high, low = (v.reshape(dof, -1) / durations[k] ** limit.order for v in (found.max(0), found.min(0)))
                with np.errstate(divide="ignore", invalid="ignore"):
                    share = np.maximum(high / limit.upper[:, None], low / limit.lower[:, None])
                least = np.maximum(least, np.nan_to_num(share.max(axis=0), nan=0.0) ** (1.0 / limit.order))
        return least

    def apply(self, x: Array) -> Array:
        """Every individual scaled, as far as the bounds on its variables allow."""
        scaled = x.copy()
        for i, s in enumerate(self.factors(x).tolist()):
            if 0.0 < s < np.inf:
                scaled[i] = self.dilate(x[i], s * (1.0 + ROOM))
        return np.clip(scaled, self.problem.lower, self.problem.upper)
