"""FATROP through CasADi: an interior-point method whose linear algebra is dense where an ``NLP`` has no stages.

Vanroye, Sathya, De Schutter and Decre (2023), IROS. Good for few variables under many rows: it takes three quarters of
IPOPT's time for the NLP of ``hybrid-spline`` (12 variables, 525 rows) and of ``rotor-353`` (3, 156), to a tolerance a
hundred times coarser. It takes a bound b for b -+ 1e-8 max(1, |b|), whatever its options; here bounds are drawn in by
as much. It neither takes multipliers of an earlier solve nor says which limits conflict, and Ctrl-C waits for its end.
(CasADi's ``sqpmethod`` with ``qrqp`` finds no feasible point of the first in 150 s.)
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.solvers.nlpsol import symbolic_solver
from ocp_traj.stopping import stopping
from ocp_traj.transcription.nlp import NLP, NLPResult, Status

RELAXED = 1e-8  # of a bound, or of one: FATROP's own
_NEAR = {"mu_init": 1e-6, "bound_push": 1e-8, "bound_frac": 1e-8}  # our choice


@dataclass(frozen=True)
class Fatrop:
    """FATROP with exact Hessians.

    Attributes:
        tol: scaled KKT error; it seldom gets below 1e-8.
        max_iter: iterations.
        feasibility: scaled violation up to which a point counts as feasible, whatever FATROP says.
        options: further FATROP options, by their own names.
    """

    tol: float = 1e-8
    max_iter: int = 500
    feasibility: float = 1e-7
    options: Mapping[str, Any] = field(default_factory=dict)

    def limited(self, iterations: int) -> Fatrop:
        """The same with at most so many iterations."""
        return replace(self, max_iter=min(self.max_iter, iterations))

    def near_start(self) -> Fatrop:
        """The same with a narrow barrier, which ends in an optimum near its start."""
        return replace(self, options={**_NEAR, **self.options})

    @one_blas_thread
    def solve(self, nlp: NLP, x0: Array, warm: NLPResult | None = None) -> NLPResult:
        """Solves an NLP from ``x0 (n,)``, clipped into the bounds; ``warm`` is of no use to it."""
        begun = time.perf_counter()
        settings = {"print_level": 0, "tol": self.tol, "max_iter": self.max_iter - 1}  # it takes one more
        options = {
            "print_time": False, "error_on_fail": False, "show_eval_warnings": False, 
            "fatrop": settings | dict(nlp.options.get("fatrop", {})) | dict(self.options),
        }  # fmt: skip
        solver = symbolic_solver(nlp, "fatrop", options)
        bounds = dict(zip(("lbx", "ubx"), _drawn_in(nlp.lower_x, nlp.upper_x), strict=True))
        bounds |= dict(zip(("lbg", "ubg"), _drawn_in(nlp.lower_g, nlp.upper_g), strict=True))
        start = np.clip(x0, nlp.lower_x, nlp.upper_x)
        if not _is_finite(solver, start):  # with which it would go on for ever
            unknown = {"x": start, "f": np.nan, "g": np.full(len(nlp.rows), np.nan), "lam_x": np.zeros(len(start))}
            unknown["lam_g"] = np.zeros(len(nlp.rows))
            words = "FATROP: no finite value or derivative at the start"
            return nlp.result(unknown, Status.FAILED, self.feasibility, 0, time.perf_counter() - begun, words)
        with stopping() as stop:
            stop.check()
            found = solver(x0=start, **bounds)
            stats = solver.stats()
            if not stats["success"]:
                stop.check()
        iterations = int(stats["iter_count"])
        if stats["success"]:
            status, words = Status.SOLVED, "FATROP: success"
        else:  # it says no more than that
            status = Status.ITERATION_LIMIT if iterations >= settings["max_iter"] else Status.FAILED
            words = "FATROP: no success"
        return nlp.result(found, status, self.feasibility, iterations, time.perf_counter() - begun, words)


def _is_finite(solver: Any, x: Array) -> bool:
    """Whether objective, rows and their first derivatives are finite at ``x (n,)``."""
    parts = [solver.get_function(name)(x, []) for name in ("nlp_grad_f", "nlp_f", "nlp_jac_g")]
    outputs = [part for found in parts for part in (found if isinstance(found, tuple) else (found,))]
    return all(np.isfinite(np.array(output)).all() for output in outputs)


def _drawn_in(lower: Array, upper: Array) -> tuple[Array, Array]:
    """Bounds that FATROP relaxes to the given ones; equal ones it leaves alone."""
    free = upper > lower
    room = np.where(free, (upper - lower) / 4.0, 0.0)
    by_low, by_high = (np.minimum(RELAXED * np.maximum(1.0, np.abs(bound)), room) for bound in (lower, upper))
    with np.errstate(invalid="ignore"):
        return np.where(np.isfinite(lower), lower + by_low, lower), np.where(np.isfinite(upper), upper - by_high, upper)
