"""Exact time scaling: individuals slowed down, or sped up, along their own path until a limit is just reached.

Dilated by s, the m-th derivative of a path falls as s^-m. Peaks are found by roots, so the least s that keeps every
limit on a derivative is known, s = max_m (peak_m / bound_m)^(1/m); limits of other kinds are left to the search.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ocp_traj.bernstein import difference_matrix, turning_values
from ocp_traj.errors import InputError
from ocp_traj.problem import Problem
from ocp_traj.symbolic import curve_function
from ocp_traj.tape import Tape

Array = NDArray[np.float64]

ROOM = 1e-9  # by which s is larger, so that rounding breaks no limit; our choice


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
