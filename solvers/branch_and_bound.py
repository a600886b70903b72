"""A certificate of global optimality for the shortest time: interval branch and bound over the ratios of durations.

Where every variable is the duration of a segment and the path depends on their ratios alone, durations x = s (1, z)
move along the same path for every s, and the m-th derivative falls as s^-m. So the shortest time of a given z that
keeps the limits on derivatives is

    T(z) = (1 + sum z) max_i (g_i(u_i; 1, z) / b_i)^(1/m_i)

over all their rows and sides i and all instants u_i: one variable less, and no constraints. Any instant gives a lower
bound of that maximum; the peaks at a box's middle give one that is tight there. Other limits (positions, efforts) are
rows e_j(z, T) <= 0; those that matter at the solution, or at a point that looks better, take part.

A box of ratios, with the times between its bound so far and the best known, is bounded by the largest of

* every row's mean value form phi(c) + grad phi(Z) (Z - c), of phi_i = (1 + sum z)^m g_i / b_i, to the power 1/m;
* the end of the times at which some e_j is positive all over the box;
* the Lagrangian sum lambda_i T_i(z) + (1 - sum lambda_i) T + sum mu_j e_j(z, T), which no feasible time is below, with
  the multipliers of the best solution. Its gradient nearly vanishes there: a bound of second order, without which boxes
  pile up around the optimum.

All of it in outward-rounded intervals (``tape``); Moore, Kearfott and Cloud, *Introduction to Interval
Analysis* (2009), chapters 6 and 11.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi
import numpy as np
from scipy.optimize import nnls

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, PathConstraint
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.interval.tape import Tape
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.values import limit_on
from ocp_traj.results.solution import Certificate, Solution
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.protocols import LocalSolver
from ocp_traj.stopping import STOPS, Stopping, stopping
from ocp_traj.transcription.symbolic import variables_function

SAMPLES = 13  # instants a segment among which a box's peaks are looked for: our choice; two refinements follow
NEAR = 0.02  # of a limit's scale: rows that do not scale and come this close at the solution take part; our choice
TRIALS = (1.0, 0.5, 0.25, 0.125)  # parts of the times left that are tried to be infeasible
BATCH = 256  # boxes cut in one pass: our choice, wide enough to amortise a step of the tape
ACTIVE = 1e-4  # relative: rows this close to the largest take part in the weighted mean; our choice
RESTARTS = 5  # solves from better points that the search comes upon
DOWN = 1.0 - 1e-15  # factor that makes a positive float, a few roundings off, a lower bound


@dataclass(frozen=True)
class BranchAndBound:
    """Certifies, or finds, the globally shortest time.

    Attributes:
        tolerance: relative gap between lower and upper bound that counts as certified.
        max_boxes: stop after so many.
        max_seconds: stop after this time.
        solver: local, for the upper bound.
        progress: told after each pass.
    """

    tolerance: float = 1e-6
    max_boxes: int = 200_000
    max_seconds: float = 60.0
    solver: LocalSolver = Exchange()
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the tolerance."""
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(f"the gap that counts as certified is {self.tolerance}; give a number between 0 and 1")

    @one_blas_thread
    def solve(self, problem: Problem, scalarisation: Scalarisation, x0: Array) -> Solution:
        """The shortest time, certified; ``x0`` starts the first local solve."""
        require_certifiable(problem, scalarisation)
        found = self.solver.solve(problem, scalarisation, x0)
        proved = found.audit is not None and found.audit.proved
        return self.improve(problem, scalarisation, found) if proved else found

    @one_blas_thread
    def improve(self, problem: Problem, scalarisation: Scalarisation, solution: Solution) -> Solution:
        """The solution with its certificate, or a better one that the search led to, with its own.

        Ctrl-C ends it early: with the solution so far and, where the search had begun, with what it had proved.
        """
        certificate: Certificate | None = None
        with stopping() as stop:
            try:
                for _ in range(RESTARTS):
                    certificate, better = self.certify(problem, scalarisation, solution, until_better=True)
                    if better is None:
                        return _certified(solution, certificate, stop)
                    again = self.solver.solve(problem, scalarisation, better)
                    if again.audit is None or not again.audit.proved or again.f >= solution.f:
                        break  # the better point led nowhere: the search has to go on beside it
                    solution, certificate = again, None
                certificate, _ = self.certify(problem, scalarisation, solution)
            except STOPS as reason:
                stop.take(reason)
            return _certified(solution, certificate, stop)

    @one_blas_thread
    def certify(
        self, problem: Problem, scalarisation: Scalarisation, solution: Solution, until_better: bool = False
    ) -> tuple[Certificate, Array | None]:
        """Bounds the shortest time from below.

        Args:
            problem: whose variables are durations; see ``Problem.scales_in_time``.
            scalarisation: of the total time alone.
            solution: a proved one: the upper bound.
            until_better: whether to stop at a point that may take less time.

        Returns:
            The certificate, and a decision vector that may lead to less time, if one was come upon.
        """
        require_certifiable(problem, scalarisation)
        if solution.audit is None or not solution.audit.proved:
            raise InputError(
                f"{problem.id}: only a proved solution can be certified; this one is {solution.status.value}"
            )
        begun = time.perf_counter()
        upper = float(np.sum(solution.x)) * (1.0 + problem.size * 2.0**-52)
        search = Search(problem, solution, upper, upper * (1.0 - 0.9 * self.tolerance))
        with stopping(self.max_seconds) as stop:
            while search.open and search.boxes < self.max_boxes and not stop.due:
                search.step()
                lower = search.lower
                self.progress(search.boxes, 0, f"{len(search.low)} boxes open, gap {(upper - lower) / upper:.2e}")
                if until_better and search.better() is not None:
                    break
        lower = min(search.lower, upper)
        certificate = Certificate(
            lower=lower,
            upper=upper,
            certified=bool(upper - lower <= self.tolerance * upper),
            boxes=search.boxes,
            seconds=time.perf_counter() - begun,
            argument="interval branch and bound over ratios of durations",
        )
        return certificate, search.better()


def _certified(solution: Solution, certificate: Certificate | None, stop: Stopping) -> Solution:
    """The solution with its certificate, and a word where Ctrl-C came before that was done."""
    cut_short = stop.tell() and not (certificate is not None and certificate.certified)
    return replace(
        solution, certificate=certificate, interrupted="before its certificate was done" if cut_short else ""
    )


def scaling_limits(problem: Problem) -> list[PathConstraint]:
    """The limits on derivatives of the joints, which slow motion relaxes."""
    limits = [c for c in problem.requirements.path_constraints if c.order is not None and c.order >= 1]
    return [c for c in limits if (c.lower < 0.0).all() and (c.upper > 0.0).all()]


def is_certifiable(problem: Problem, scalarisation: Scalarisation) -> bool:
    """Whether ``BranchAndBound`` applies: time alone, durations alone, limits on derivatives."""
    return _obstacle(problem, scalarisation) is None


def require_certifiable(problem: Problem, scalarisation: Scalarisation) -> None:
    """Raises ``InputError`` where ``BranchAndBound`` does not apply."""
    obstacle = _obstacle(problem, scalarisation)
    if obstacle is not None:
        raise InputError(f"{problem.id} cannot be certified: {obstacle}")


def _obstacle(problem: Problem, scalarisation: Scalarisation) -> str | None:
    if not problem.scales_in_time:
        return "its variables are not durations of segments alone"
    if problem.size < 2:
        return "it has one duration, and no ratios of durations to search"
    if not scaling_limits(problem):
        return "no derivative of its joints is limited"
    names = scalarisation.names
    bounded = getattr(scalarisation, "bounds", None) or getattr(scalarisation, "goals", None)
    objective = problem.objective(names[0])
    if len(names) != 1 or bounded or objective.of_variables is None or objective.sense != "min":
        return f"only the total time alone can be, not {', '.join(names)}"
    x = casadi.SX.sym("x", problem.size)
    slope = casadi.gradient(variables_function(problem, objective)(x), x)
    if casadi.symvar(slope) or not np.allclose(np.array(casadi.evalf(slope)).ravel(), 1.0, rtol=0, atol=0):
        return f"only the total time can be, not {objective.id}"
    return None


def _peaks(values: Callable[[Array], Array], rows: int, count: int) -> Array:
    """Instants in [0, 1] at which rows are about largest: ``(rows, count)``.

    Args:
        values: instants ``(rows, M, count)`` -> values of the same shape.
        rows: how many.
        count: of points.
    """
    grid = np.linspace(0.0, 1.0, SAMPLES)
    found = values(np.broadcast_to(grid[None, :, None], (rows, SAMPLES, count)))
    best = grid[np.argmax(found, axis=1)]
    step = grid[1]
    for _ in range(3):
        inside = np.clip(best, step, 1.0 - step)  # a peak close to an end needs a point on either side
        around = inside[:, None] + step * np.array([-1.0, 0.0, 1.0])[None, :, None]
        left, middle, right = np.moveaxis(values(around), 1, 0)
        a, b, c = np.moveaxis(around, 1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            fall, rise = (b - a) * (middle - right), (b - c) * (middle - left)
            vertex = b - 0.5 * ((b - a) * fall - (b - c) * rise) / (fall - rise)
        vertex = np.where(np.isfinite(vertex), np.clip(vertex, a, c), b)
        trial = np.clip(np.stack([a, b, c, vertex, best], axis=1), 0.0, 1.0)
        best = np.take_along_axis(trial, np.argmax(values(trial), axis=1)[:, None], axis=1)[:, 0]
        step /= 8.0
    return np.asarray(best)


class _Scaling:
    """Rows of the limits on derivatives, one a joint, segment and side, as lower bounds of T^m over the ratios z."""

    def __init__(self, problem: Problem) -> None:
        z = casadi.SX.sym("z", problem.size - 1)
        total = 1.0 + casadi.sum1(z)
        curve = problem.curve(casadi.vertcat(1.0, z))
        limits = scaling_limits(problem)
        segments, joints = range(curve.segments), range(curve.dof)
        rows = [(c, k, j, bound[j]) for c in limits for k in segments for j in joints for bound in (c.lower, c.upper)]
        rows = [row for row in rows if np.isfinite(row[3])]
        instants = [casadi.SX.sym("u") for _ in rows]
        values, orders = [], []
        for (limit, k, j, bound), u in zip(rows, instants, strict=True):
            order = int(limit.order or 0)
            values.append(curve.at(k, u, order)[j] * total**order / bound)
            orders.append(order)
        self.count, self.powers = len(rows), np.array(orders)
        self.z, self.u, self.phi = z, casadi.vertcat(*instants), casadi.cse(casadi.vertcat(*values))
        # Bounds on durations: lower_k (1 + sum z) / z_k <= T <= upper_k (1 + sum z) / z_k.
        self.shares = Tape(casadi.Function("shares", [z], [casadi.densify(total / casadi.vertcat(1.0, z))]))
        self.value = Tape(casadi.Function("phi", [z, self.u], [casadi.densify(self.phi)]))
        slopes = casadi.vec(casadi.densify(casadi.jacobian(self.phi, z)))
        self.slopes = Tape(casadi.Function("slopes", [z, self.u], [casadi.cse(slopes)]))

    def times(self, scaled: Array) -> Array:
        """Times from values of T^m."""
        return np.asarray(np.maximum(scaled, 0.0) ** (1.0 / self.powers[:, None]))

    def peaks(self, z: Array) -> Array:
        """Instants at which each row is about largest, at points ``z (n - 1, N)``: ``(rows, N)``."""

        def scaled(u: Array) -> Array:
            return self.value.evaluate(np.tile(z, u.shape[1]), u.reshape(self.count, -1))[0].reshape(u.shape)

        return _peaks(scaled, self.count, z.shape[1])


class _Others:
    """Rows e(z, T) <= 0 of limits that do not scale: (limit, row, segment, side) each, side 1 for the upper bound."""

    def __init__(self, problem: Problem, chosen: Sequence[tuple[str, int, int, int]]) -> None:
        self.chosen, self.count = tuple(chosen), len(chosen)
        self.z, self.t = casadi.SX.sym("z", problem.size - 1), casadi.SX.sym("T")
        x = self.t * casadi.vertcat(1.0, self.z) / (1.0 + casadi.sum1(self.z))
        curve, parameters = problem.curve(x), problem.parameters(x)
        limits = {limit.id: limit for limit in problem.requirements.path_constraints}
        instants, values = [], []
        for name, row, k, side in self.chosen:
            limit, u = limits[name], casadi.SX.sym("u")
            state = casadi.vertcat(*(casadi.densify(curve.at(k, u, order).T) for order in range(len(ORDERS))))
            constants = casadi.DM([] if limit.constants is None else limit.constants[k])
            g = problem.requirements.function(limit)(state, u, parameters, constants)[row]
            excess = g - limit.upper[row] if side > 0 else limit.lower[row] - g
            instants.append(u)
            values.append(excess / limit.scale[row])
        y = casadi.vertcat(self.z, self.t)
        self.u = casadi.vertcat(casadi.SX(0, 1), *instants)
        self.e = casadi.vertcat(casadi.SX(0, 1), *values)
        self.value = Tape(casadi.Function("e", [y, self.u], [casadi.cse(casadi.densify(self.e))]))
        slopes = casadi.vec(casadi.densify(casadi.jacobian(self.e, y)))
        self.slopes = Tape(casadi.Function("slopes", [y, self.u], [casadi.cse(slopes)]))

    def peaks(self, y: Array) -> Array:
        """Instants at which each row is about largest, at points ``(z, T) (n, N)``: ``(rows, N)``."""

        def excess(u: Array) -> Array:
            return self.value.evaluate(np.tile(y, u.shape[1]), u.reshape(self.count, -1))[0].reshape(u.shape)

        return _peaks(excess, self.count, y.shape[1])


class Search:
    """Open boxes of ratios, and what is known of those that are closed."""

    def __init__(self, problem: Problem, solution: Solution, upper: float, threshold: float) -> None:
        self.problem, self.solution, self.upper, self.threshold = problem, solution, upper, threshold
        self.rows = problem.cached("branch and bound rows", lambda: _Scaling(problem))
        low = np.nextafter(problem.lower[1:] / problem.upper[0], 0.0)
        high = np.nextafter(problem.upper[1:] / problem.lower[0], np.inf)
        self.low, self.high = low[None], high[None]
        self.bounds = np.zeros(1)
        self.closed = np.inf  # least bound of a closed box
        self.boxes = 1
        self.candidate: tuple[float, Array] = (np.inf, np.empty(0))
        assert solution.trajectory is not None
        self._choose(_near_rows(problem, solution.trajectory))

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
        self.others = _Others(self.problem, others)
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
        wide = np.argmax(np.log(high / low), axis=1)
        places = np.arange(len(low))
        a, b = low[places, wide], high[places, wide]
        cut = np.where(b > 2.0 * a, np.sqrt(a * b), 0.5 * (a + b))
        left, right = high.copy(), low.copy()
        left[places, wide] = cut
        right[places, wide] = cut
        low, high = np.concatenate([low, right]), np.concatenate([left, high])
        parents = np.tile(self.bounds[chosen], 2)
        bounds = np.maximum(self.bound(low, high, parents), parents)
        self.boxes += len(low)
        stuck = np.tile((cut <= a) | (cut >= b), 2)  # too narrow to be cut: its bound is the last word
        shut = (bounds >= self.threshold) | stuck
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
            scaled = _mean_value(rows.value, rows.slopes, box, centre, u)[0]
            best = (np.maximum(scaled, 0.0) ** (1.0 / rows.powers[:, None]) * DOWN).max(axis=0)
            shares = rows.shares.enclose(box)[0]
            shortest, longest = self.problem.lower[:, None], self.problem.upper[:, None]
            least = _product(shares, (shortest, shortest))[0].max(axis=0)
            most = _product(shares, (longest, longest))[1].min(axis=0)
            best = np.maximum(np.where(np.isnan(best), 0.0, best), np.maximum(least, known))
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
                broken = (_mean_value(others.value, others.slopes, whole, point, instants)[0] > 0.0).any(axis=0)
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
        spread = _outward(whole[0] - point, whole[1] - point)
        change = _sum([_product((a, b), (c, d)) for a, b, c, d in zip(*slopes, *spread, strict=True)])[0]
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
        broken = _near_rows(self.problem, trajectory_of(self.problem, x), 0.0)
        if broken:  # it looked better only because of rows left out: take them in
            self._choose(tuple(dict.fromkeys((*self.others.chosen, *broken))))
        else:
            self.candidate = (float(total[best]), centre[:, best].copy())


def _near_rows(problem: Problem, candidate: Trajectory, share: float = NEAR) -> list[tuple[str, int, int, int]]:
    """Rows of limits that do not scale that are broken, or within a share of their scale of it, by segment and side."""
    found = []
    scaling = scaling_limits(problem)
    for limit in problem.requirements.path_constraints:
        if limit in scaling:
            continue
        for k in range(candidate.curve.segments):
            for row, side in ((r, s) for r in range(len(limit.labels)) for s in (1, -1)):
                bound = limit.upper[row] if side > 0 else -limit.lower[row]

                def signed(
                    u: Array, limit: PathConstraint = limit, k: int = k, row: int = row, side: int = side
                ) -> Array:
                    values = limit_on(candidate, problem.requirements, limit, k, u.ravel())[row]
                    return np.asarray(side * values.reshape(u.shape))

                if np.isfinite(bound) and signed(_peaks(signed, 1, 1)).max() > bound - share * limit.scale[row]:
                    found.append((limit.id, row, k, side))
    return found


Pair = tuple[Any, Any]


def _outward(lower: Any, upper: Any) -> Pair:
    return np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)


def _product(a: Pair, b: Pair) -> Pair:
    corners = np.stack(np.broadcast_arrays(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]))
    unknown = np.isnan(corners).any(axis=0)
    low, high = _outward(corners.min(axis=0), corners.max(axis=0))
    return np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)


def _sum(pairs: Sequence[Pair]) -> Pair:
    low, high = pairs[0]
    for a, b in pairs[1:]:
        low, high = _outward(low + a, high + b)
    return low, high


def _mean_value(value: Tape, slopes: Tape, box: Pair, centre: Array, u: Array) -> Pair:
    """Enclosure of rows over boxes by their mean value form, and by the tape itself."""
    instants = (u, u)
    spread = _outward(box[0] - centre, box[1] - centre)
    gradients = _grouped(slopes.enclose(box, instants), len(u))
    change = _sum([_product(slope, (c[None], d[None])) for slope, c, d in zip(gradients, *spread, strict=True)])
    start = value.enclose((centre, centre), instants)[0]
    form = _outward(start[0] + change[0], start[1] + change[1])
    plain = value.enclose(box, instants)[0]
    return np.fmax(form[0], plain[0]), np.fmin(form[1], plain[1])


def _grouped(outputs: Sequence[Pair], count: int) -> list[Pair]:
    """Slopes by variable, from a column-major Jacobian."""
    low, high = outputs[0]
    return [(low[i : i + count], high[i : i + count]) for i in range(0, len(low), count)]
