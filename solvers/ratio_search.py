"""The search of a certificate: boxes of ratios of durations, and what the shortest time over each is bounded by."""

from __future__ import annotations

from collections.abc import Sequence

import casadi
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.interval.tape import Tape
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.duration_rows import DOWN, OtherRows, ScalingRows, near_rows
from ocp_traj.solvers.interval_forms import Pair, mean_value, outward, product, total_of

TRIALS = (1.0, 0.5, 0.25, 0.125)  # parts of the times left that are tried to be infeasible
BATCH = 256  # boxes cut in one pass: our choice, wide enough to amortise a step of the tape
ACTIVE = 1e-4  # relative: rows this close to the largest take part in the weighted mean; our choice


def all_ratios(problem: Problem) -> tuple[Array, Array]:
    """The one box that holds all ratios of durations to the first: ends ``(1, n - 1)`` each."""
    low = np.nextafter(problem.lower[1:] / problem.upper[0], 0.0)
    high = np.nextafter(problem.upper[1:] / problem.lower[0], np.inf)
    return low[None], high[None]


def halves(low: Array, high: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Boxes ``(N, n - 1)`` cut in two across their longest side: ends ``(2 N, n - 1)``, and which were too narrow."""
    wide = np.argmax(np.log(high / low), axis=1)
    places = np.arange(len(low))
    a, b = low[places, wide], high[places, wide]
    cut = np.where(b > 2.0 * a, np.sqrt(a * b), 0.5 * (a + b))
    left, right = high.copy(), low.copy()
    left[places, wide] = cut
    right[places, wide] = cut
    stuck = np.tile((cut <= a) | (cut >= b), 2)
    return np.concatenate([low, right]), np.concatenate([left, high]), stuck


class Search:
    """Open boxes of ratios, and what is known of those that are closed."""

    def __init__(self, problem: Problem, solution: Solution, upper: float, threshold: float) -> None:
        self.problem, self.solution, self.upper, self.threshold = problem, solution, upper, threshold
        self.rows = problem.cached("branch and bound rows", lambda: ScalingRows(problem))
        self.low, self.high = all_ratios(problem)
        self.bounds = np.zeros(1)
        self.closed = np.inf  # least bound of a closed box
        self.boxes = 1
        self.candidate: tuple[float, Array] = (np.inf, np.empty(0))
        assert solution.trajectory is not None
        self._choose(near_rows(problem, solution.trajectory))

    @property
    def open(self) -> bool:
        """Whether a box is left to cut."""
        return bool(len(self.low))

    @property
    def lower(self) -> float:
        """No time is shorter."""
        return float(min(self.closed, self.bounds.min(initial=np.inf)))

    def better(self) -> Array | None:
        """A decision vector that may take less time than the threshold."""
        value, z = self.candidate
        if not value < self.threshold:
            return None
        x = np.append(1.0, z) / (1.0 + z.sum()) * value
        return np.asarray(np.clip(x, self.problem.lower, self.problem.upper))

    def _choose(self, others: Sequence[tuple[str, int, int, int]]) -> None:
        """Takes rows that do not scale into account, and makes the Lagrangian anew."""
        self.others = OtherRows(self.problem, others)
        self._lagrangian = self._multipliers()

    def _multipliers(self) -> tuple[Array, Tape] | None:
        """Multipliers of the module's Lagrangian at the solution, and its tape; None where no row is active there.

        Non-negative least squares on the stationarity conditions in z and T,
        sum lambda_i dT_i/dz + sum mu_j de_j/dz = 0 and sum lambda_i - sum mu_j de_j/dT = 1.

        Returns:
            lambda of the active rows that scale, then mu of the others ``(active + others,)`` [-, s]; the tape
            (y, u of the rows, u of the others, multipliers) -> L [s] and dL/dy ``(n,)``, with y = (z, T).
        """
        rows, others, x = self.rows, self.others, self.solution.x
        z, total = x[1:] / x[0], float(x.sum())
        point, full = z[:, None], np.append(z, total)[:, None]
        u = rows.peaks(point)
        times = rows.times(rows.value.evaluate(point, u)[0])[:, 0]
        active = np.nonzero((times >= total * (1.0 - ACTIVE)) & (times > 0.0))[0]
        slopes = rows.slopes.evaluate(point, u)[0].reshape(len(z), rows.count)[:, active]
        slopes = slopes * times[active] ** (1 - rows.powers[active]) / rows.powers[active]
        slopes = np.vstack([slopes, np.ones(len(active))])
        if others.count:
            more = others.slopes.evaluate(full, others.peaks(full))[0].reshape(len(z) + 1, others.count)
            slopes = np.hstack([slopes, more * np.append(np.ones(len(z)), -1.0)[:, None]])
        if not slopes.size:
            return None
        size = np.maximum(np.abs(slopes).max(axis=0), 1e-300)
        found = nnls(slopes / size, np.append(np.zeros(len(z)), 1.0))[0] / size
        if not found.any():
            return None
        m = casadi.SX.sym("m", len(found))
        share = casadi.sum1(m[: len(active)]) if len(active) else 0.0
        mean = (1.0 - share) * others.t
        for i, row in enumerate(active.tolist()):
            mean += m[i] * rows.phi[row] ** (1.0 / float(rows.powers[row]))
        for j in range(others.count):
            mean += m[len(active) + j] * casadi.substitute(others.e[j], others.z, rows.z)
        y = casadi.vertcat(rows.z, others.t)
        outputs = [mean, casadi.densify(casadi.gradient(mean, y))]
        tape = Tape(casadi.Function("lagrangian", [y, rows.u, others.u, m], casadi.cse(outputs)))
        return found, tape

    def step(self) -> None:
        """Cuts the boxes of least bound in two and bounds the halves."""
        chosen = np.argsort(self.bounds, kind="stable")[:BATCH]
        low, high = self.low[chosen], self.high[chosen]
        keep = np.ones(len(self.low), dtype=bool)
        keep[chosen] = False
        low, high, stuck = halves(low, high)
        parents = np.tile(self.bounds[chosen], 2)
        bounds = np.maximum(self.bound(low, high, parents), parents)
        self.boxes += len(low)
        shut = (bounds >= self.threshold) | stuck  # of one too narrow to be cut the bound is the last word
        self.closed = min(self.closed, float(bounds[shut].min(initial=np.inf)))
        self.low = np.concatenate([self.low[keep], low[~shut]])
        self.high = np.concatenate([self.high[keep], high[~shut]])
        self.bounds = np.concatenate([self.bounds[keep], bounds[~shut]])

    def bound(self, low: Array, high: Array, known: Array) -> Array:
        """Lower bounds of T over boxes ``(N, n - 1)``; inf where nothing is feasible.

        Args:
            low: lower ends of the boxes.
            high: upper ends.
            known: lower bounds that hold already ``(N,)``.
        """
        rows, box = self.rows, (low.T, high.T)
        centre = np.clip(0.5 * (low + high), low, high).T
        u = rows.peaks(centre)
        self._remember(centre, rows.times(rows.value.evaluate(centre, u)[0]))
        with np.errstate(invalid="ignore", over="ignore"):
            least, most = rows.times_over(box, centre, u)
            best = np.maximum(least, known)
            best = np.where(best > most, np.inf, best)
            rest = np.nonzero(best < self.threshold)[0]
            if len(rest):
                part = (low[rest].T, high[rest].T)
                best[rest] = self.with_others(part, centre[:, rest], u[:, rest], best[rest])
        return best

    def with_others(self, box: Pair, centre: Array, u: Array, best: Array) -> Array:
        """Better bounds by the rows that do not scale, and by the Lagrangian."""
        others, end = self.others, np.full(len(best), self.threshold)
        instants = np.zeros((0, len(best)))
        if others.count:
            instants = others.peaks(np.vstack([centre, 0.5 * (best + end)[None]]))
            for fraction in TRIALS:
                until = np.minimum(best + fraction * (end - best), end)
                whole = (np.vstack([box[0], best[None]]), np.vstack([box[1], until[None]]))
                point = np.vstack([centre, np.clip(0.5 * (best + until), best, until)[None]])
                broken = (mean_value(others.value, others.slopes, whole, point, instants)[0] > 0.0).any(axis=0)
                best = np.where(broken, until, best)
        if self._lagrangian is None:
            return best
        multipliers, tape = self._lagrangian
        end = np.full(len(best), self.upper)  # not the threshold: it may be beyond, and bounds are as good as they are
        whole = (np.vstack([box[0], best[None]]), np.vstack([box[1], end[None]]))
        point = np.vstack([centre, np.clip(0.5 * (best + end), best, end)[None]])
        m = np.repeat(multipliers[:, None], len(best), axis=1)
        fixed = [(given, given) for given in (u, instants, m)]
        start = tape.enclose((point, point), *fixed)[0][0]
        slopes = tape.enclose(whole, *fixed)[1]
        spread = outward(whole[0] - point, whole[1] - point)
        change = total_of([product((a, b), (c, d)) for a, b, c, d in zip(*slopes, *spread, strict=True)])[0]
        found = np.nextafter(start[0] + change, -np.inf) * DOWN
        # Of times beyond its end the Lagrangian says nothing but that they are beyond it.
        return np.asarray(np.maximum(best, np.minimum(np.where(np.isfinite(found), found, 0.0), end)))

    def _remember(self, centre: Array, times: Array) -> None:
        """Keeps the middle with the least time that the limits looked at allow."""
        z = np.vstack([np.ones(centre.shape[1]), centre])
        shares = z.sum(axis=0) / z
        total = np.maximum(times.max(axis=0), (self.problem.lower[:, None] * shares).max(axis=0))
        total = np.where(total <= (self.problem.upper[:, None] * shares).min(axis=0), total, np.inf)
        hopeful = np.nonzero(total < min(self.threshold, self.candidate[0]))[0]
        if self.others.count and len(hopeful):
            y = np.vstack([centre[:, hopeful], total[None, hopeful]])
            excess = self.others.value.evaluate(y, self.others.peaks(y))[0].max(axis=0)
            hopeful = hopeful[excess <= 0.0]
        if not len(hopeful):
            return
        best = int(hopeful[np.argmin(total[hopeful])])
        x = z[:, best] / z[:, best].sum() * total[best]
        broken = near_rows(self.problem, trajectory_of(self.problem, x), 0.0)
        if broken:  # it looked better only because of rows left out: take them in
            self._choose(tuple(dict.fromkeys((*self.others.chosen, *broken))))
        else:
            self.candidate = (float(total[best]), centre[:, best].copy())
