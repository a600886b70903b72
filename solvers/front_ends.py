"""The ends of a front: the best trajectory of each objective, with the others inside the reference box."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ocp_traj.errors import NoSolutionFound
from ocp_traj.formulation.scalarise import EpsilonConstraint, Scalarisation
from ocp_traj.parallel.workers import Pending
from ocp_traj.progress import silent
from ocp_traj.results.records import of_solve
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.by_levels import ByLevels
from ocp_traj.solvers.front_points import FrontPoints
from ocp_traj.solvers.front_rays import start_within
from ocp_traj.solvers.multistart import Multistart
from ocp_traj.solvers.starts import LONGEST
from ocp_traj.solvers.waves import Request
from ocp_traj.transcription.instants import few_with
from ocp_traj.transcription.nlp import Status

# Of the front's extent: what an end may lose in its own objective, room that an interior point needs, and what it must
# gain in the other for that; our choice.
LOSS, WORTHWHILE = 1e-5, 1e-3


@dataclass
class FrontEnds:
    """Finds the ends, from random starts: nothing is known yet.

    Attributes:
        front: gets them.
        many: solves from random starts; its seed is that of the first objective's.
        unsolved: objectives whose end is only the best point known.
        tried: whether all were.
    """

    front: FrontPoints
    many: Multistart
    unsolved: list[str] = field(default_factory=list)
    tried: bool = False

    def find(self) -> None:
        """The best point of each objective, with the others inside the reference box.

        An end that no start reaches is tried once more from the other ends; if that fails as well, the best dilation of
        theirs stands in for it, and ``unsolved`` says so.
        """
        front, work = self.front, self.front.work
        missing: list[tuple[str, Solution]] = []
        begun = [self._many(k).begin(front.problem, self._end(name)) for k, name in enumerate(front.names)
                 if front.problem.levels is None]  # fmt: skip
        for k, name in enumerate(front.names):
            solution = self._from_guesses(self._end(name), k, f"the best {name}", begun[k] if begun else None)
            work.count(self._end(name), solution)
            if solution.ok:
                front.add(solution)
            else:
                missing.append((name, solution))
        for name, failure in missing:
            if not len(front):
                raise NoSolutionFound(
                    f"{failure.explain()} (the least {name}, the others within the reference point); "
                    "no end of the front was found"
                )
            bounds = {front.names.index(n): self._sign(n) * bound for n, bound in self._end(name).bounds.items()}
            x0, nearest = start_within(front, list(range(len(front))), bounds)
            solution = work.again(Request(self._end(name), x0))
            if solution.ok:
                front.add(solution)
                continue
            self.unsolved.append(name)
            stand_in = front.evaluated(x0, front.solutions[nearest])
            if stand_in is not None:
                work.found(of_solve(self._end(name), stand_in))
                front.add(stand_in)
        self.tried = True

    def sharpen(self) -> None:
        """Makes each of two ends the best in the other objective as well, from itself and from random starts.

        Where one objective cannot be pushed further many trajectories have its best value, and in a problem with many
        local optima the augmentation alone does not find the best of those.
        """
        front = self.front
        for k, name in enumerate(front.names):
            span = np.ptp(front.values, axis=0)
            if len(front) != 2 or front.flat.any():
                return
            other, value = front.names[1 - k], front.values[k, k]
            scalar = EpsilonConstraint(other, {name: float(front.signs[k] * (value + LOSS * span[k]))})
            front.tell(f"the best {other} of those")
            nearest = front.work.again(Request(scalar, front.solutions[k].x, front.solutions[k]), LONGEST)
            if nearest.status is not Status.SOLVED:  # next to nothing is left inside: random starts would fail as well
                continue
            many = self._many(len(front.names) + k)
            first = few_with(front.problem, nearest.instants, nearest.x)
            many = replace(many, solver=replace(many.solver, first=first))
            solution = many.solve(front.problem, scalar, beside=nearest, gain=WORTHWHILE * span[1 - k])
            front.work.count(scalar, solution)
            if solution.ok and front.value(solution)[1 - k] < front.values[k, 1 - k] - WORTHWHILE * span[1 - k]:
                front.replace(front.solutions[k], solution)

    def _many(self, number: int) -> Multistart:
        """The random starts of one end: others than those of another."""
        return replace(self.many, seed=self.many.seed + number)

    def _from_guesses(
        self, scalar: Scalarisation, number: int, words: str, begun: dict[int, list[Pending]] | None = None
    ) -> Solution:
        front = self.front

        def tell(done: int, total: int, _: str) -> None:
            front.tell(f"{words}, {done} of {total} starts")

        told = silent if front.progress is silent else tell
        many = replace(self._many(number), progress=told)
        if front.problem.levels is None:
            return many.solve(front.problem, scalar, begun)
        return ByLevels(many, refine=False).solve(front.problem, scalar)

    def _end(self, name: str) -> EpsilonConstraint:
        known = self.front.problem.reference_point
        bounds = {n: known[n] for n in self.front.names if n != name and n in known}
        return EpsilonConstraint(name, bounds, augmentation=1e-6)

    def _sign(self, name: str) -> float:
        return float(self.front.signs[self.front.names.index(name)])
