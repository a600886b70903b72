"""Fronts of two objectives: the widest gap between neighbours is halved, by epsilon-constraints.

The gap is measured by the area of the box that two neighbours span, which bounds what hypervolume is still to be had
there. It is halved along its longer side: one objective is bounded at the middle, the other minimised. The solve begins
in the middle of the two, which is nearer by an order than they are, or, where they are of two families, at the best
dilation of either that meets the bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp_traj.arrays import Array, Flags
from ocp_traj.formulation.scalarise import EpsilonConstraint
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.front_points import FrontPoints
from ocp_traj.solvers.front_rays import start_within
from ocp_traj.solvers.waves import Begun, Request
from ocp_traj.transcription.symbolic import evaluate_objectives

NARROW = 1e-12  # of the front's extent: no gap is narrower; our choice


@dataclass(frozen=True)
class _Gap:
    """Two neighbours on the front, their values of the first objective, and the extent of the front."""

    one: Solution
    other: Solution
    ends: tuple[float, float]
    extent: bytes


@dataclass(frozen=True)
class FrontCurve:
    """Fills the gaps of a front of two objectives.

    Attributes:
        front: with its two ends.
    """

    front: FrontPoints

    def fill(self) -> None:
        """Halves the widest gap until there are enough points or no gap is left."""
        front, span = self.front, np.ptp(self.front.values, axis=0)
        if front.flat.any():  # there is nothing to trade: the end that is better where they differ is best in both
            front.keep([int(np.argmin(front.values[:, ~front.flat].sum(axis=1)))])
            front.conflict = False
            return
        closed: set[tuple[float, float]] = set()  # gaps in which nothing new was found
        begun: dict[_Gap, Begun] = {}
        while (left := front.wanted - len(front)) > 0:
            gaps = self._widest(span, closed)
            if not gaps:
                near = np.asarray(self._near(np.sort(front.values, axis=0)).any(axis=0))
                front.unresolved = {
                    n: float(r) for n, r, is_near in zip(front.names, front.resolution, near, strict=True) if is_near
                }
                return
            # Those that are likely to be next are begun by workers that have nothing else to do. Which one is taken,
            # and what is asked of it, does not depend on that.
            for gap in gaps[: 1 + min(front.work.workers.ahead, left - 1)]:
                if gap not in begun:
                    begun[gap] = front.work.begin(self._halved(gap, span))
            gap = gaps[0]
            if not self._merge(begun.pop(gap), span):
                closed.add(gap.ends)

    def _widest(self, span: Array, closed: set[tuple[float, float]]) -> list[_Gap]:
        """The gaps between neighbours that are still open, the widest first."""
        front = self.front
        order = np.argsort(front.values[:, 0])
        values = front.values[order]
        areas = (np.abs(np.diff(values, axis=0)) / span).prod(axis=1)
        near = np.asarray(self._near(values).any(axis=1))
        extent = np.ptp(values, axis=0).tobytes()
        gaps = []
        for i in np.argsort(-areas, kind="stable").tolist():
            pair = front.solutions[order[i]], front.solutions[order[i + 1]]
            gap = _Gap(*pair, (float(values[i, 0]), float(values[i + 1, 0])), extent)
            if areas[i] > NARROW and not near[i] and gap.ends not in closed:
                gaps.append(gap)
        return gaps

    def _near(self, values: Array) -> Flags:
        """In which objectives neighbours are as near as these are told ``(N - 1, 2)``."""
        resolution = self.front.resolution
        return np.asarray((np.abs(np.diff(values, axis=0)) <= resolution) & (resolution > 0.0))

    def _halved(self, gap: _Gap, span: Array) -> Request:
        """What to solve for a point in the middle of a gap."""
        front = self.front
        pair = [next(i for i, known in enumerate(front.solutions) if known is one) for one in (gap.one, gap.other)]
        values = front.values[pair]
        bounded = int(np.argmax(np.abs(np.diff(values, axis=0))[0] / span))
        bound = float(values[:, bounded].mean())
        scalar = EpsilonConstraint(
            front.names[1 - bounded], {front.names[bounded]: float(front.signs[bounded] * bound)}, augmentation=1e-6
        )
        middle = self._middle(pair)
        if middle is not None:  # beside the neighbour that meets the bound
            x0, nearest = middle, pair[int(np.argmin(values[:, bounded]))]
        else:
            x0, nearest = start_within(front, pair, {bounded: bound})
        known = front.solutions[nearest]
        others = [front.solutions[i].x for i in pair if i != nearest]
        several = front.problem.tuning.starts > 1
        # Where solutions are compared, or asked for less than they keep, each is proved at once. Where one fails, once
        # more from the neighbours themselves and with all rows; of many local optima the other may lead to a better.
        return Request(
            scalar, x0, known,
            prove=front.problem.tighten_slacks is not None or several,
            fallbacks=[known.x] if several else [known.x, *others], others=others if several else [],
        )  # fmt: skip

    def _middle(self, pair: list[int]) -> Array | None:
        """The middle of two neighbours of one family of trajectories, which has its objectives between theirs."""
        front = self.front
        x = np.mean([front.solutions[i].x for i in pair], axis=0)
        objectives, known = evaluate_objectives(front.problem, x), front.values[pair]
        values = front.signs * np.array([objectives[name] for name in front.names])
        return x if ((known.min(axis=0) <= values) & (values <= known.max(axis=0))).all() else None

    def _merge(self, begun: Begun, span: Array) -> bool:
        """Adds the point that comes of a request, if there is one that is not there already."""
        front = self.front
        solution = front.work.take(begun, front.replace)
        new = solution.ok and front.take(solution, span)
        front.tell()
        front.work.prove_many()
        return new
