"""``scipy.optimize.minimize`` with SLSQP and trust-constr, as its manual has it for rows with exact gradients."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import BFGS, Bounds, NonlinearConstraint, minimize
from scipy.sparse import csr_matrix

Array = NDArray[np.float64]
SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "SLSQP, ftol 1e-9": ("SLSQP", {"maxiter": 400, "ftol": 1e-9}),  # 400: MATLAB's default for its sqp
    "SLSQP, as it comes": ("SLSQP", {}),
    "trust-constr, a small first barrier": ("trust-constr", {
        "gtol": 1e-5, "initial_tr_radius": 0.1, "initial_barrier_parameter": 0.01, "initial_barrier_tolerance": 0.01,
    }),
    "trust-constr, as it comes": ("trust-constr", {}),
}  # fmt: skip
BEST = {"SLSQP": "SLSQP, ftol 1e-9", "trust-constr": "trust-constr, a small first barrier"}


def solve(
    cost: Callable[[Array], float], gradient: Callable[[Array], Array], rows: Callable[[Array], Array],
    jacobian: Callable[[Array], csr_matrix], bounds_x: tuple[Array, Array], bounds_g: tuple[Array, Array], x0: Array,
    setting: str,
) -> tuple[Array, bool, int]:  # fmt: skip
    """End ``(n,)``, whether the solver says that it converged, iterations.

    Args:
        cost: to be minimised, with its ``gradient`` ``(n,)``.
        gradient: see ``cost``.
        rows: ``(m,)``, with their ``jacobian`` ``(m, n)``, which SLSQP wants dense.
        jacobian: see ``rows``.
        bounds_x: lower and upper, of variables.
        bounds_g: lower and upper, of rows.
        x0: start, within its bounds.
        setting: one of ``SETTINGS``.
    """
    method, options = SETTINGS[setting]
    slope = jacobian if method == "trust-constr" else lambda x: jacobian(x).toarray()
    held = NonlinearConstraint(rows, *bounds_g, jac=slope, hess=BFGS())
    more = {"hess": BFGS()} if slope is jacobian else {}
    found = minimize(
        cost, x0, jac=gradient, method=method, bounds=Bounds(*bounds_x), constraints=[held], options=options, **more
    )
    return np.clip(found.x, *bounds_x), bool(found.success), found.nit
