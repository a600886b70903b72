"""Front tracing: a Pareto front by warm-started local solves, each of them proved.

First the ends, from random starts: the best trajectory of each objective, with the others inside the reference box.
Then what lies between them: a curve for two objectives, whose widest gap is halved by epsilon-constraints; a surface
for more, where goal attainment aims at what is open of the box, and time scaling gives most of the points.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ocp_traj.blas import one_blas_thread
from ocp_traj.formulation.case import check, count
from ocp_traj.formulation.problem import Problem
from ocp_traj.parallel.workers import Workers
from ocp_traj.progress import Progress, silent
from ocp_traj.results.pareto_set import ENDED_AFTER, ParetoSet, check_traded
from ocp_traj.results.records import Found, ignore
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.front_completion import complete_early
from ocp_traj.solvers.front_curve import FrontCurve
from ocp_traj.solvers.front_ends import FrontEnds
from ocp_traj.solvers.front_points import FrontPoints
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.waves import Solves
from ocp_traj.stopping import STOPS, stopping

if TYPE_CHECKING:
    from ocp_traj.solvers.front_surface import FrontSurface


@dataclass(frozen=True)
class FrontTracer:
    """Traces a front of ``points`` points.

    Of two objectives each point is a solve that halves the widest gap of the curve. Of more, as many solves that give a
    point aim where the surface has most to gain, the dilations of what they find that add to it are proved as well, and
    of all these the points stay that dominate most together.

    Attributes:
        points: how many, at most.
        solver: of each point.
        starts: random starts at each end of the front, where nothing is known yet.
        seed: of those starts.
        max_seconds: stop after this, in the middle of a point, with those that are there.
        workers: who solves; the front does not depend on it.
        progress: told after each point.
        found: given a record of each solve.
        beside: objectives by id of points that are known of another front. Where one of them dominates the ideal point,
            nothing is traced between the ends.
    """

    points: int = count(40, least=2)
    solver: Exchange = field(default_factory=Exchange)
    starts: int = count(2)
    seed: int = 0
    max_seconds: float = np.inf
    workers: Workers = field(default_factory=Workers)
    progress: Progress = silent
    found: Found = ignore
    beside: Sequence[Mapping[str, float]] = ()

    def __post_init__(self) -> None:
        """Checks the number of points."""
        check(self)

    @one_blas_thread
    def pareto(self, problem: Problem, objectives: Sequence[str]) -> ParetoSet:
        """Traces the front of two or more objectives; Ctrl-C ends it early with the points it has."""
        check_traded(objectives)
        begun = time.perf_counter()
        work = Solves(problem, self.solver, self.workers, self.found)
        front = FrontPoints(problem, tuple(objectives), work, self.points, self.progress)
        starts = max(self.starts, problem.tuning.starts)
        many = Multistart(self.solver, starts, self.seed, workers=self.workers, found=self.found)
        ends = FrontEnds(front, many)
        surface: FrontSurface | None = None
        info: dict[str, Any] = {}
        with stopping(self.max_seconds) as stop:
            complete = False
            try:
                ends.find()
                if front.adds_nothing_to(self.beside):
                    info["nothing traced"] = "a point of another alternative dominates the ends"
                elif len(objectives) == 2:
                    if problem.tuning.starts > 1:
                        ends.sharpen()
                    FrontCurve(front).fill()
                elif self.points > len(front):
                    surface = _surface(front)
                    surface.fill()
                work.prove()
                complete = True
            except STOPS as reason:
                stop.take(reason)
                work.prove(again=False)
                if surface is None and self.points > len(objectives):
                    beginnings = [] if stop.interrupted else ends.many.points(problem)  # may take long
                    info["points without a solve"] = complete_early(front, beginnings)
            interrupted = not complete and stop.tell()
        info |= {
            "solves": work.solves,
            "iterations": work.iterations,
            "failed": work.failed,
            "unsolved ends": ends.unsolved,
        }
        if surface is not None:
            surface.thin()
            info |= {"points by time scaling": surface.dilations, "unreachable": surface.unreachable}
        if not front.conflict:
            info["conflict"] = False
        if front.unresolved:
            info["unresolved"] = front.unresolved
        if not complete:
            info[ENDED_AFTER] = f"{len(front)} of {self.points} points"
        if ends.tried and not ends.unsolved:
            info["ideal"] = front.ideal
        xs = [solution.x for solution in front.solutions]
        return ParetoSet(xs, "trace", self.seed, time.perf_counter() - begun, info, interrupted)


def _surface(front: FrontPoints) -> FrontSurface:
    from ocp_traj.solvers.front_surface import FrontSurface  # its samples' library is slow to import

    return FrontSurface(front)
