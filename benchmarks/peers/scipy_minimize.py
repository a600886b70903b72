"""``scipy.optimize.minimize`` with SLSQP and trust-constr, as its manual has it for rows with exact gradients."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, NonlinearConstraint, minimize

Array = NDArray[np.float64]
SETTINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "SLSQP, ftol 1e-9": ("SLSQP", {"maxiter": 400, "ftol": 1e-9}),  # 400: MATLAB's default for its sqp
    "SLSQP, as it comes": ("SLSQP", {}),
    "trust-constr, as it comes": ("trust-constr", {}),
    "trust-constr, gtol 1e-4, barrier_tol 1e-6": ("trust-constr", {"gtol": 1e-4, "barrier_tol": 1e-6}),
}
BEST = {"SLSQP": "SLSQP, ftol 1e-9", "trust-constr": "trust-constr, gtol 1e-4, barrier_tol 1e-6"}


def solve(
    cost: Callable[[Array], float], gradient: Callable[[Array], Array], rows: Callable[[Array], Array],
    jacobian: Callable[[Array], Array], bounds_x: tuple[Array, Array], bounds_g: tuple[Array, Array], x0: Array,
    setting: str,
) -> tuple[Array, bool, int]:  # fmt: skip
    """End ``(n,)``, whether the solver says that it converged, iterations.

    Args:
        cost: to be minimised, with its ``gradient`` ``(n,)``.
        gradient: see ``cost``.
        rows: ``(m,)``, with their ``jacobian`` ``(m, n)``.
        jacobian: see ``rows``.
        bounds_x, bounds_g: lower and upper, of variables and rows.
        x0: start, within its bounds.
        setting: one of ``SETTINGS``.
    """
    method, options = SETTINGS[setting]
    held = NonlinearConstraint(rows, *bounds_g, jac=jacobian)
    found = minimize(
        cost, x0, jac=gradient, method=method, bounds=Bounds(*bounds_x), constraints=[held], options=options
    )
    return np.clip(found.x, *bounds_x), bool(found.success or found.status in (1, 2) and method != "SLSQP"), found.nit
