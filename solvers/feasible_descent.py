"""Descent by steps that keep every limit: from a proved point to a better one, stopped at any time with what it has.

A sequence of programs in which distances between bodies, and nothing else, are taken to first order in the joints,
within a trust region on these: durations and derivatives are as they are, so that one step makes a motion with a stop
at every corner one without. What a program ends with is slowed down, or sped up, to where a derivative reaches its
limit, and counts where a scan finds all distances kept: a motion never goes through what is in the way, as iterates of
an interior point method may. Feasible iterates are after Kiessling, Zanelli, Nurkanovic, Gillis, Diehl, Zeilinger,
Pipeleers and Swevers (2022, CDC), whose programs are linear throughout: these take some twenty times as many steps.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation, WeightedSum
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.solution import Solution
from ocp_traj.results.time_scaling import ROOM, TimeScaling
from ocp_traj.results.trajectory import Trajectory, audit_points
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.stopping import STOPS, current
from ocp_traj.transcription.derivative_peaks import derivative_peaks
from ocp_traj.transcription.instants import Instant, few_instants, uniform_instants
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from ocp_traj.transcription.transcription import transcribe
from ocp_traj.transcription.worst_instants import broken_instants, lowest_instants

Proved = tuple[Array, Trajectory, Audit]

TIME = "time"  # the objective
FIRST, WIDEST, NARROWEST, WIDER = 0.08, 0.3, 4e-3, 1.5  # radius of the trust region on joints at knots [rad, m]: ours
STRETCH = 2.5  # factor, of both ways, on each duration in one step: our choice
INSTANTS = 7  # a segment, of limits on derivatives; what peaks are higher between is made up for by slowing down
PEAKS = 0.8  # of a limit, from which on a derivative's turning points are held as well: our choice
NEAR = 0.6  # of the size of a limit on distances, how near rows are that are looked at: our choice
MARGIN = 5e-3  # of the size of a limit on distances, by which its rows are kept off their bound: our choice
LESSONS = 1  # how often, in one step, a program is solved again with rows of what its solution ran into
SHRINK = 2.0  # of the radius, where a step does not gain, or runs into something
ENOUGH = 5e-3  # relative gain of a step, or of a program's solution, below which it ends: our choice
STEPS = 40  # at most
AUDITED = 4  # steps from one proof to the next: our choice
SOLVER = Ipopt.rough(1e-3, 40)  # no finer than the margin: our choice


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
        limits, hull = self.problem.requirements.path_constraints, self.problem.tuning.hull_rows
        within = {limit.id for limit in limits if limit.id in hull and not limit.order}
        grid = [i for i in uniform_instants(self.problem, INSTANTS) if i.limit not in within]
        self.fixed = [*grid, *(i for i in few_instants(self.problem) if i.limit in within)]
        self.still = [limit.id for limit in self.problem.path_limits if not limit.order]  # slowing down mends it not
        self.scaling = TimeScaling(self.problem)
        names = np.concatenate([np.full(len(v.labels), v.id) for v in self.problem.variables])
        self.joints, self.durations = names == "q", names == "T"

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
        taken, values = [x], [first]
        try:
            while steps < STEPS:
                current().check()
                found, radius = self._step(taken[-1], values[-1], radius)
                if found is None:
                    words = "; no step was left that gains"
                    break
                steps += 1
                taken.append(found)
                values.append(self._value(found))
                self.progress(steps, STEPS, f"{values[-1]:.6g}")
                if values[-2] - values[-1] < ENOUGH * abs(values[-1]):
                    words = "; the last step gained little"
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
        problem, learnt = self.problem, 0
        instants = [*derivative_peaks(problem, x, PEAKS), *lowest_instants(problem, x, NEAR)]
        while radius >= NARROWEST:
            y, predicted = self._nearby(x, instants, radius)
            if value - predicted < ENOUGH * abs(value):
                break
            gain = -np.inf if y is None else value - self._value(y)
            missed = broken_instants(problem, y) if y is not None and gain > 0.0 else []
            if gain > 0.0 and not missed:
                return y, min(WIDER * radius, WIDEST)
            if missed and learnt < LESSONS:  # what it ran into is looked at from here
                instants, learnt = [*instants, *missed], learnt + 1
            else:
                radius /= SHRINK
        return None, radius

    def _nearby(self, x: Array, instants: Sequence[Instant], radius: float) -> tuple[Array | None, float]:
        """The best point about ``x (n,)`` with distances to first order, and its value before it is slowed down."""
        problem = self.problem
        nlp = transcribe(problem, self.scalarisation, [*self.fixed, *instants], about=x)
        g = nlp.program.values(x)[1]
        margin = np.where(np.isin([row.limit for row in nlp.rows], self.still), MARGIN, 0.0)
        reach = np.where(self.joints, radius, np.inf)
        low, high = (
            np.where(self.durations, x * factor, x + side)
            for factor, side in ((1.0 / STRETCH, -reach), (STRETCH, reach))
        )
        around = replace(
            nlp, lower_g=np.minimum(nlp.lower_g + margin, g), upper_g=np.maximum(nlp.upper_g - margin, g),
            lower_x=np.maximum(nlp.lower_x, low), upper_x=np.minimum(nlp.upper_x, high),
        )  # fmt: skip
        found = SOLVER.solve(around, x)
        slower = float(self.scaling.factors(found.x[None])[0])
        if problem.dilate is None or not 0.0 < slower < np.inf:
            return None, -np.inf
        y = np.where(nlp.upper_x > nlp.lower_x, problem.dilate(found.x, slower * (1.0 + ROOM)), nlp.lower_x)
        inside = ((y >= problem.lower) & (y <= problem.upper)).all()
        return (y if inside else None), found.f if found.ok else -np.inf
