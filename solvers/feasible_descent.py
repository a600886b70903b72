"""Descent by steps that keep every limit: from a proved point to a better one, stopped at any time with what it has.

Feasible sequential linear programming (Kiessling, Zanelli, Nurkanovic, Gillis, Diehl, Zeilinger, Pipeleers and Swevers,
2022, CDC, for time-optimal motions): a linear program within a trust region, whose constant terms are corrected by the
rows' values at its own solution, with the slopes kept, until that solution keeps the rows. It is then slowed down, or
sped up, to where a derivative reaches its limit. So a motion never goes through what is in the way, as iterates of an
interior point method may, and each step that is taken is one that a scan has found clear.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_matrix, vstack

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.formulation.scalarise import Scalarisation, WeightedSum
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import ROOM, TimeScaling
from ocp_traj.results.trajectory import Trajectory, audit_points
from ocp_traj.stopping import STOPS, current
from ocp_traj.transcription.instants import Instant, few_instants, uniform_instants
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from ocp_traj.transcription.transcription import transcribe
from ocp_traj.transcription.worst_instants import broken_instants, lowest_instants

solve_linear: Any = linprog  # whose stubs do not know bounds as an array
Proved = tuple[Array, Trajectory, Audit]

TIME = "time"  # the objective
FIRST, WIDEST, NARROWEST = 0.1, 0.3, 1e-3  # radius of the trust region: of durations relative; our choice
DERIVATIVES = 4.0  # to the power k, times the radius: of the k-th derivative at a knot, in its unit; our choice
INSTANTS = 11  # a segment, of limits on derivatives; what peaks are higher between is made up for by slowing down
CORRECTIONS = 3  # linear programs with the same slopes: our choice
CORRECTED = 1e-3  # largest excess of a scaled row that is not corrected further: our choice
LESSONS = 3  # how often, in one step
SHRINK = 2.0  # of the radius, where a step does not gain, or runs into something
REACH, FARTHEST = (
    15.0,
    0.6,
)  # times the radius, and at most, of the size of a limit on distances, how near rows are that are looked at: ours
MARGIN = 5e-3  # of the size of a limit on distances, by which its rows are kept off their bound: our choice
ENOUGH = 5e-3  # relative gain of the last PATIENCE steps below which it ends: our choice
PATIENCE = 3
STEPS = 100  # at most
AGAIN = 2  # how often it tries the first radius once more where no step is left: our choice
AUDITED = 8  # steps from one proof to the next: our choice


def descends(problem: Problem, scalarisation: Scalarisation) -> bool:
    """Whether starts of a problem keep its limits, and what is minimised is less the sooner a path is through."""
    return problem.tuning.descends and problem.dilate is not None and scalarisation == WeightedSum({TIME: 1.0})


@dataclass
class FeasibleDescent:
    """A descent of one problem from a proved point.

    Args:
        problem: whose variables can be slowed down.
        scalarisation: what is minimised.
        progress: told of each step.
    """

    problem: Problem
    scalarisation: Scalarisation
    progress: Progress = silent
    fixed: Sequence[Instant] = field(init=False)

    def __post_init__(self) -> None:
        """Compiles what all steps share."""
        hull = self.problem.tuning.hull_rows
        orders = {limit.id: limit.order for limit in self.problem.requirements.path_constraints}
        grid = [i for i in uniform_instants(self.problem, INSTANTS) if orders[i.limit] or i.limit not in hull]
        self.fixed = [*grid, *(i for i in few_instants(self.problem) if i.control is not None and not orders[i.limit])]
        self.scaling = TimeScaling(self.problem)
        blocks = [(v.id, len(v.labels)) for v in self.problem.variables]
        self.durations = np.concatenate([np.full(n, name == "T") for name, n in blocks])
        powers = {name: DERIVATIVES**order for order, name in enumerate(ORDERS)}
        self.sizes = np.concatenate([np.full(n, powers.get(name.split()[0], DERIVATIVES)) for name, n in blocks])

    def solve(self, x0: Array) -> Solution | None:
        """The best point found, proved; None where the start is not."""
        problem, begun = self.problem, time.perf_counter()
        x = np.where(problem.inactive(self.scalarisation.names), problem.lower, np.asarray(x0, dtype=float))
        proved = self._proved([x])
        if proved is None:
            return None
        # Steps are within limits on derivatives and distances; of others there is a proof after each.
        every = AUDITED if all(limit.order is not None for limit in problem.requirements.path_constraints) else 1
        radius, steps, words, interrupted, first = FIRST, 0, "", "", self._value(x)
        taken, values, again = [x], [first], AGAIN
        try:
            while steps < STEPS:
                current().check()
                found, radius = self._step(taken[-1], values[-1], radius)
                if found is None and again:  # peaks between instants stop the shortest steps first
                    radius, again = FIRST, again - 1
                    continue
                if found is None:
                    words = "; no step was left that gains"
                    break
                steps += 1
                taken.append(found)
                values.append(self._value(found))
                self.progress(steps, STEPS, f"{values[-1]:.6g}")
                if len(values) > PATIENCE and values[-1 - PATIENCE] - values[-1] < ENOUGH * abs(values[-1]):
                    words = "; the last steps gained little"
                    break
                if steps % every == 0:
                    later = self._proved(taken[1:])
                    if later is None or later[0] is not taken[-1]:  # back to what is proved, with shorter steps
                        radius /= SHRINK
                    proved = later or proved
                    taken, values = [proved[0]], [self._value(proved[0])]
        except STOPS as reason:
            current().take(reason)
            interrupted = f"after {steps} steps of descent"
        proved = self._proved(taken[1:]) or proved
        best, trajectory, audit = proved
        return Solution(
            problem.id, best, self._value(best), Status.FEASIBLE, 0.0, steps, time.perf_counter() - begun,
            objectives=evaluate_objectives(problem, best), trajectory=trajectory, audit=audit, interrupted=interrupted,
            detail=f"{steps} feasible steps from a proved start of {first:.6g}{words}",
        )  # fmt: skip

    def _proved(self, points: Sequence[Array]) -> Proved | None:
        """The last of some points that is proved, with its trajectory and audit; None where none is."""
        for x in reversed(points):
            ((trajectory, audit),) = audit_points(self.problem, [x])
            if audit.proved:
                return x, trajectory, audit
        return None

    def _value(self, x: Array) -> float:
        return float(self.scalarisation.apply(self.problem, evaluate_objectives(self.problem, x)).f)

    def _step(self, x: Array, value: float, radius: float) -> tuple[Array | None, float]:
        """A better point that keeps the limits, and the next radius; None where there is none."""
        instants = lowest_instants(self.problem, x, min(FARTHEST, REACH * radius))
        model = _Model(self, x, instants)
        learnt = 0
        while radius >= NARROWEST:
            y, predicted = model.lowest(radius)
            missed = [] if y is None else broken_instants(self.problem, y)
            gain = -np.inf if y is None else value - self._value(y)
            if gain > 0.0 and not missed:
                share = gain / max(predicted, 1e-300)
                return y, min(2.0 * radius, WIDEST) if share > 0.5 else radius / 2.0 if share < 0.2 else radius
            if gain > 0.0 and learnt < LESSONS:  # what it ran into is looked at from here
                instants, learnt = [*instants, *missed], learnt + 1
                model = _Model(self, x, instants)
            else:
                radius /= SHRINK
        return None, radius


class _Model:
    """Rows and their slopes at a point ``x (n,)``, kept for linear programs of any radius."""

    def __init__(self, descent: FeasibleDescent, x: Array, instants: Sequence[Instant]) -> None:
        problem = self.problem = descent.problem
        nlp = self.nlp = transcribe(problem, descent.scalarisation, [*descent.fixed, *instants])
        self.scaling, program, self.x = descent.scaling, nlp.program, x
        self.g = program.values(x)[1]
        sparsity = program.jacobian_sparsity
        places = np.array(sparsity.row()), np.array(sparsity.colind())
        self.slopes = csc_matrix((program.jacobian(x), *places), (program.rows, program.size))
        self.gradient = program.gradient(x)
        known = [limit.id for limit in problem.path_limits if not limit.order]
        self.still = np.isin([row.limit for row in nlp.rows], known)  # what slowing down does not mend
        margin = np.where(self.still, MARGIN, 0.0)
        self.lower = np.minimum(nlp.lower_g + margin, self.g)
        self.upper = np.maximum(nlp.upper_g - margin, self.g)
        free = nlp.upper_x > nlp.lower_x
        self.sizes = np.where(free, np.where(descent.durations, x, descent.sizes), 0.0)

    def lowest(self, radius: float) -> tuple[Array | None, float]:
        """Where the corrected linear programs lead, slowed down until derivatives keep their limits; and their gain."""
        x, nlp, reach = self.x, self.nlp, radius * self.sizes
        low, high = (np.clip(side - x, -reach, reach) for side in (nlp.lower_x, nlp.upper_x))
        box = np.stack([np.minimum(low, 0.0), np.maximum(high, 0.0)], axis=1)
        span = np.asarray(abs(self.slopes) @ reach)
        above, below = np.flatnonzero(span >= self.upper - self.g), np.flatnonzero(span >= self.g - self.lower)
        matrix = vstack([self.slopes[above], -self.slopes[below]]).tocsr()
        offset, step = np.zeros(len(self.g)), np.zeros(len(x))
        for _ in range(CORRECTIONS):
            room = np.concatenate([(self.upper - self.g - offset)[above], (self.g + offset - self.lower)[below]])
            solved: Any = solve_linear(
                self.gradient, matrix, room, bounds=box, method="highs-ds", options={"presolve": False}
            )
            if solved.x is None:
                break
            step = solved.x
            g = nlp.program.values(x + step)[1]
            offset = g - self.g - self.slopes @ step
            if max(float((g - self.upper).max()), float((self.lower - g).max())) <= CORRECTED:
                break
        y, gain = x + step, -float(self.gradient @ step)
        slower = float(self.scaling.factors(y[None])[0])
        if self.problem.dilate is None or not 0.0 < slower < np.inf:
            return None, gain
        y = np.where(self.sizes > 0.0, self.problem.dilate(y, slower * (1.0 + ROOM)), nlp.lower_x)
        inside = ((y >= self.problem.lower) & (y <= self.problem.upper)).all()
        return (y if inside else None), gain
