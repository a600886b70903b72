"""Fronts of three and more objectives: waves of goal attainment where most is open, and the rays of what is found.

Each solve aims at a point of the box that is neither dominated nor known to be out of reach, and minimises the largest
excess over it in units of the box (Pascoletti and Serafini, 1984): it ends on the front, above the target or below it,
and nothing is better there in every objective. It begins at that dilation of any earlier solution which comes nearest
to the target, with that one's instants and multipliers. After each wave the dilations of what was found that add to the
front are proved, all together: for a tenth of the time they are most of its points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.formulation.scalarise import GoalAttainment
from ocp_traj.parallel.job import Job
from ocp_traj.proof.verdicts import PROVED
from ocp_traj.results.solution import Solution
from ocp_traj.solvers import front_rays
from ocp_traj.solvers.front_directions import OpenBox, well_spread
from ocp_traj.solvers.front_points import FLAT, SAME, FrontPoints
from ocp_traj.solvers.front_rays import Rays
from ocp_traj.solvers.waves import Request
from ocp_traj.stopping import current
from ocp_traj.transcription.nlp import Status

WAVE = 8  # solves that do not know of each other: our choice
TOGETHER = 40  # points of rays that are proved together: our choice
# A point of a ray costs a proof, some thirtieth of a solve: it is worth that if it adds so much of what a solve of the
# last waves has added. Our choice.
WORTH, LATELY = 1.0 / 30.0, 3
TRIES = 2  # solves a point that is wanted, after which those that gave none are too many: our choice
LITTLE = 1e-5  # of the box: where less than this is open nothing is to be had; our choice
ILLEGAL = 1.0  # of the box: by how much a start that breaks a limit is behind one that does not; our choice
BEHIND = 1e-4  # of the box: a solve that ends this much behind a point that is known is done again from there; ours


@dataclass(frozen=True, eq=False)
class _Aim:
    """A target ``(m,)`` of a solve; ``again`` if a solve for it has ended behind a point that was known."""

    target: Array
    again: bool = False


class FrontSurface:
    """Finds points between the ends of a front.

    Args:
        front: with its ends.

    Attributes:
        dilations: how many points were found as dilations of others.
        unreachable: at how many targets the front lies outside the box.
    """

    def __init__(self, front: FrontPoints) -> None:
        """The box between the ends' best values and the reference point, or their worst where there is none."""
        self.front = front
        self.dilations = self.unreachable = 0
        self._traded: Index = np.flatnonzero(~front.flat)  # what all ends have in common is kept, and not traded
        self._best = front.values.min(axis=0)
        worst = np.where(np.isfinite(front.reference), front.reference, front.values.max(axis=0))
        self._worst = worst + np.where(front.flat, FLAT * np.abs(worst), 0.0)
        self._span = self._worst - self._best
        self._rays = Rays(front.problem, front.population, front.signs)
        self._solved: list[Solution] = []  # whose rays those are
        self._gained: list[float] = []  # what a solve of each wave has added, on average

    def fill(self) -> None:
        """Aims where most is open, until as many solves gave a point as points are wanted or nothing is open."""
        front = self.front
        if len(self._traded) < 2:
            front.keep([int(np.argmin(front.values[:, self._traded].sum(axis=1)))])
            front.conflict = False
            return
        self._box = OpenBox(self._best[self._traded], self._worst[self._traded])
        self._box.add(front.values[:, self._traded])
        points, tried = len(front), 0
        again: list[_Aim] = []
        self._add_rays(list(front.solutions))
        while points < front.wanted and tried < TRIES * front.wanted:
            room = min(WAVE, front.wanted - points)
            aims = [*again, *map(_Aim, self._targets(room - len(again)))]
            if not aims:
                return
            found, again = self._wave(aims)
            tried += len(aims)
            points += found
            self._box.refill()
            front.tell(f"{len(front)} points, {self.dilations} of them dilations", min(points, front.wanted))

    def thin(self) -> None:
        """Keeps as many points as are wanted, those that dominate most of the box together, the ends among them."""
        front = self.front
        ends = np.unique(front.values.argmin(axis=0))
        among = np.ix_(np.arange(len(front)), self._traded)
        corners = self._best[self._traded], self._worst[self._traded]
        front.keep(well_spread(front.values[among], *corners, front.wanted, ends).tolist())

    def _targets(self, count: int) -> list[Array]:
        """Where to aim next ``(m,)`` each; none where nothing is open."""
        if count < 1 or self._box.undecided < LITTLE:
            return []
        targets = []
        for values in self._box.next_targets(count):
            target = self._best.copy()
            target[self._traded] = values
            targets.append(target)
        return targets

    def _wave(self, aims: Sequence[_Aim]) -> tuple[int, list[_Aim]]:
        """Solves for targets that do not know of each other: how many gave a point, and what to solve once more."""
        front = self.front
        ended: dict[int, Solution] = {}

        def arrived(place: int, _: Solution | None, solution: Solution) -> None:
            ended[place] = solution
            if solution.ok and self._inside(front.value(solution)):
                front.take(solution, self._span)

        begun = [front.work.begin(self._request(aim.target)) for aim in aims]
        for place, one in enumerate(begun):
            solution = front.work.take(one, partial(arrived, place))
            if solution.audit is not None or not solution.ok:  # the others arrive once they are proved
                arrived(place, None, solution)
        front.work.prove()
        solved = [ended[place] for place in range(len(aims)) if ended[place].ok]
        values = np.array([front.value(one) for one in solved]).reshape(-1, len(front.names))
        values = values[[self._inside(value) for value in values]][:, self._traded]
        self._gained.append(float(self._box.gains(values).sum()) / len(aims))
        self._box.add(values)
        again = [aim for place, aim in enumerate(aims) if not self._decided(aim, ended[place])]
        self._add_rays(solved)
        return len(values), [replace(aim, again=True) for aim in again]

    def _decided(self, aim: _Aim, solution: Solution) -> bool:
        """Whether a solve tells where the front is beside a target, which is then noted; if not, it is done again."""
        if not solution.ok:
            self._box.close(aim.target[self._traded])
            return True
        value = self.front.value(solution)
        own, best = (float(self._excess(aim.target, v).min()) for v in (value[None], self.front.values))
        if own > best + BEHIND and not aim.again:
            return False
        self._box.close((aim.target + min(own, best) * self._span)[self._traded])
        self.unreachable += not self._inside(value)
        return True

    def _request(self, target: Array) -> Request:
        """What to solve for a target ``(m,)``: from the best dilation of what was solved.

        In a problem with many local optima from the best one of another solution as well.
        """
        front, problem = self.front, self.front.problem
        behind = self._excess(target, self._rays.values) + ILLEGAL * ~self._rays.legal
        first = int(np.argmin(behind))
        behind = np.where(self._rays.owner == self._rays.owner[first], np.inf, behind)
        several = problem.tuning.starts > 1
        second = [self._rays.x(int(np.argmin(behind)))] if several and np.isfinite(behind).any() else []
        known = self._solved[self._rays.owner[first]]
        traded = [(front.names[k], float(front.signs[k]), k) for k in self._traded]
        kept = [(name, k) for k, name in enumerate(front.names) if k not in self._traded]
        scalar = GoalAttainment(
            {name: sign * float(target[k]) for name, sign, k in traded},
            {name: float(self._span[k]) for name, _, k in traded},
            {name: float(front.signs[k] * self._worst[k]) for name, k in kept},
        )
        # Where solutions are compared, or asked for less than they keep, each is proved at once.
        at_once = problem.tighten_slacks is not None or several
        return Request(scalar, self._rays.x(first), known, prove=at_once, fallbacks=[known.x], others=second)

    def _add_rays(self, solved: Sequence[Solution]) -> None:
        """Takes the rays of solutions, and proves those of their dilations that add most to the front."""
        rays = self._rays
        candidates = [np.empty(0, dtype=np.intp)]
        for solution in solved:
            self._solved.append(solution)
            candidates.append(rays.add(solution.x))
        new = np.concatenate(candidates)
        new = new[rays.legal[new] & (rays.factor[new] != 1.0) & (rays.values[new] <= self._worst).all(axis=1)]
        least = WORTH * float(np.mean(self._gained[-LATELY:])) if self._gained else 0.0
        chosen = new[self._box.best_of(rays.values[new][:, self._traded], least)]
        for begin in range(0, len(chosen), TOGETHER):
            current().check()
            self._prove(chosen[begin : begin + TOGETHER])

    def _prove(self, candidates: Index) -> None:
        """Proves dilations; those that are proved join the front."""
        front = self.front
        xs = [self._rays.x(int(candidate)) for candidate in candidates]
        (answer,) = front.work.workers.run([Job(front_rays.PROVED, front.problem, {"xs": xs})])
        front.work.found(answer)
        for candidate, x, point in zip(candidates, xs, answer["points"], strict=True):
            if point["verdict"] != PROVED:
                continue
            like = self._solved[self._rays.owner[candidate]]
            dilated = replace(like, x=x, status=Status.FEASIBLE, objectives=dict(point["objectives"]), key="")
            if front.take(dilated, self._span):
                self.dilations += 1
                self._box.add(front.value(dilated)[self._traded])

    def _excess(self, target: Array, values: Array) -> Array:
        """By how much values ``(N, m)`` are behind a target, in units of the box ``(N,)``."""
        return np.asarray(((values - target) / self._span)[:, self._traded].max(axis=1))

    def _inside(self, value: Array) -> bool:
        return bool((value <= self._worst + SAME * self._span).all())
