"""The time law s(t) of a motion q(s(t)) along a given path: its values at knots are given, its derivatives are not.

Between knots it is a Hermite polynomial in its duration and in its derivatives at both ends, so that a segment of the
motion depends on few variables. (With the places of the knots free as well, solves seldom converge.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi
import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.curves.bernstein import PiecewiseBezier, basis, subdivision_matrix
from ocp_traj.curves.composition import compose
from ocp_traj.curves.families import hermite
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.first_law import first_law
from ocp_traj.formulation.problem import Variable
from ocp_traj.paths.joint_path import JointPath
from ocp_traj.paths.path_arcs import PathArcs, nearest
from ocp_traj.robot.joint_limits import JointLimits

SHORTEST, LONGEST = 1e-3, 1e2  # bounds of durations, of the guessed ones: our choice, far from any optimum met
SLOWER = (1.0, 1.3)  # random starts are so many times slower than the guess: our choice
NAMES = ("s", "s'", "s''", "s'''")


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """A time law and the motion it makes of a path.

    Attributes:
        path: the path; its parameter is s.
        limits: of the joints.
        rows: s and its derivatives at a knot, 2 to 4: C1 cubics, C2 quintics or C3 septics.
        pieces: segments from one point of the path to the next; see ``PathArcs.of``.
        rest: derivatives of the joints that vanish at both ends.
    """

    path: JointPath
    limits: JointLimits
    rows: int
    pieces: int
    rest: int

    @cached_property
    def cut(self) -> PathArcs:
        """The path, cut at the knots."""
        return PathArcs.of(self.path, self.pieces, self.rests)

    @property
    def arcs(self) -> PiecewiseBezier:
        """The path of each segment, its ``durations`` the steps of s."""
        return self.cut.curve

    @cached_property
    def rests(self) -> tuple[bool, bool]:
        """Whether the law rests at the start and at the end.

        Where the path's own derivatives vanish there the joints rest whatever the law.
        """
        curve, orders, found = self.path.curve, range(1, self.rest + 1), []
        for segment, u in ((0, 0.0), (curve.segments - 1, 1.0)):
            sizes = [np.abs(curve.hodograph(segment, order)).max() for order in orders]
            values = [np.abs(curve.at(segment, u, order)).max() for order in orders]
            found.append(any(value > 1e-9 * size for value, size in zip(values, sizes, strict=True)))
        return found[0], found[1]

    @cached_property
    def count(self) -> int:
        """Number of segments K."""
        return self.arcs.segments

    @cached_property
    def free(self) -> list[tuple[int, int]]:
        """Knot and order of each derivative that is a variable, by order."""
        ends = [knot for knot, rests in zip((0, self.count), self.rests, strict=True) if rests]
        held = {(knot, order) for knot in ends for order in range(1, self.rest + 1)}
        return [(k, order) for order in range(1, self.rows) for k in range(self.count + 1) if (k, order) not in held]

    @cached_property
    def places(self) -> Index:
        """Which variable each derivative is ``(K + 1, rows - 1)``; -1 for one that is 0."""
        found = np.full((self.count + 1, self.rows - 1), -1)
        for i, (k, order) in enumerate(self.free):
            found[k, order - 1] = self.count + i
        return found

    @cached_property
    def guessed(self) -> tuple[Array, Array]:
        """Durations ``(K,)`` [s], and s' at knots ``(K + 1,)``, of a law near the limits."""
        moving = self.places[[0, -1], 0] >= 0
        return first_law(self.arcs, self.limits, (bool(moving[0]), bool(moving[1])))

    @cached_property
    def unit(self) -> float:
        """A time near the pieces' [s]: the k-th derivative is a variable over its k-th power."""
        return float(np.median(self.guessed[0]))

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Durations, and the derivatives of each order."""
        durations = self.guessed[0]
        found = [
            Variable("T", SHORTEST * durations, LONGEST * durations, "s", tuple(f"T{k + 1}" for k in range(self.count)))
        ]
        speed = self.limits.bounds(1)
        for order in range(1, self.rows):
            own = [k for k, m in self.free if m == order]
            if not own:  # of one piece from rest to rest
                continue
            high, limits = np.full(len(own), np.inf), tuple[tuple[str, str], ...]()
            if order == 1 and speed is not None:  # what a knot's velocities allow
                slopes = np.abs([self.arcs.at(min(k, self.count - 1), float(k == self.count), 1)[0] for k in own])
                with np.errstate(divide="ignore"):
                    each = np.where(slopes > 0.0, np.maximum(-speed[0], speed[1]), np.inf) / slopes
                high = each.min(axis=1)
                limits = tuple(("velocity-limit", self.path.joints[j]) for j in each.argmin(axis=1))
            low = np.zeros(len(own)) if order == 1 else -high
            labels = tuple(f"{NAMES[order]}{k}" for k in own)
            bounds = low * self.unit**order, high * self.unit**order
            found.append(Variable(NAMES[order], *bounds, "-", labels, bounded_by=limits))
        return tuple(found)

    def laws(self, x: Any) -> tuple[Any, list[Any]]:
        """Durations ``(K,)`` and control points ``(2 rows,)`` of each segment's part of s, from 0 to 1."""
        symbolic = isinstance(x, casadi.SX)
        durations = x[: self.count]
        found = []
        for k in range(self.count):
            ends = []
            for knot, place in ((k, 0.0), (k + 1, 1.0)):
                rates = [
                    x[int(i)] * (self.unit**-order / self.arcs.durations[k]) if i >= 0 else 0.0
                    for order, i in enumerate(self.places[knot], 1)
                ]
                ends.append(casadi.vertcat(place, *rates) if symbolic else np.array([[place], *([r] for r in rates)]))
            found.append(hermite([casadi.SX(e) for e in ends] if symbolic else ends, durations[k : k + 1]))
        return durations, [law.control_points[0] if symbolic else law.control_points[0][:, 0] for law in found]

    def curve(self, x: Any) -> PiecewiseBezier:
        """The motion."""
        x = x if isinstance(x, casadi.SX) else np.asarray(x, dtype=float)
        durations, laws = self.laws(x)
        points = (compose(path, law) for path, law in zip(self.arcs.control_points, laws, strict=True))
        return PiecewiseBezier(durations, tuple(points))

    def packed(self, durations: Array, laws: list[Array]) -> Array:
        """The decision vector of durations and control points of each segment's part of s."""
        parts = PiecewiseBezier(durations, tuple(law[:, None] for law in laws))
        rates = np.zeros((self.count + 1, self.rows - 1))
        for order in range(1, self.rows):
            own = [parts.hodograph(k, order)[:, 0] * self.arcs.durations[k] for k in range(self.count)]
            rates[:, order - 1] = [*(part[0] for part in own), own[-1][-1]]
        return np.concatenate([durations, [rates[k, order - 1] * self.unit**order for k, order in self.free]])

    def variables_of(self, curve: PiecewiseBezier) -> Array:
        """The decision vector of a numeric curve of this shape: the law is found from places along each segment."""
        degree = 2 * self.rows - 1
        expected = [n * degree for n in self.arcs.degrees]
        if list(curve.degrees) != expected or curve.dof != self.arcs.dof:
            raise ProblemDefinitionError(
                f"a curve of {curve.segments} segments and {curve.dof} joints was given; it has to have {self.count} "
                f"and {self.arcs.dof}, of this path and law"
            )
        inner = (1.0 - np.cos(np.pi * np.arange(1, degree) / degree)) / 2.0
        weights = basis(degree, inner)
        laws = []
        for k in range(self.count):
            reached = nearest(self.arcs, k, curve.at(k, inner))
            laws.append(np.concatenate([[0.0], np.linalg.solve(weights[:, 1:-1], reached - weights[:, -1]), [1.0]]))
        return self.packed(np.asarray(curve.durations, dtype=float), laws)

    def dilate(self, x: Array, factor: float) -> Array:
        """The decision vector of the same motion, ``factor`` times slower."""
        slower = np.array(x, dtype=float)
        slower[: self.count] *= factor
        slower[self.count :] /= factor ** np.array([float(order) for _, order in self.free])
        return slower

    def refined(self, coarser: TimeLaw, x: Array) -> Array:
        """The decision vector of the motion that is ``x`` of a law with fewer pieces, a whole fraction of these."""
        parts = self.count // coarser.count
        durations, laws = coarser.laws(np.asarray(x, dtype=float))
        times, found = [], []
        for k, (duration, law) in enumerate(zip(durations, laws, strict=True)):
            steps = self.arcs.durations[k * parts : (k + 1) * parts]
            places = np.append(0.0, np.cumsum(steps)) / steps.sum()
            cuts = np.array([0.0, *(instant(law, place) for place in places[1:-1]), 1.0])
            for i in range(parts):
                own = (subdivision_matrix(len(law) - 1, cuts[i], cuts[i + 1]) @ law - places[i]) / np.diff(places)[i]
                times.append(duration * (cuts[i + 1] - cuts[i]))
                found.append(np.concatenate([[0.0], own[1:-1], [1.0]]))
        return self.packed(np.array(times), found)

    def guess(self, rng: np.random.Generator) -> Array:
        """A start within the bounds."""
        durations, speed = self.guessed
        rates = np.zeros((self.count + 1, self.rows - 1))
        rates[:, 0] = speed
        if self.rows > 2:
            slopes = np.diff(speed) / durations
            rates[1:-1, 1] = 0.5 * (slopes[1:] + slopes[:-1])
        x = np.concatenate([durations, [rates[k, order - 1] * self.unit**order for k, order in self.free]])
        lower, upper = (np.concatenate([getattr(v, side) for v in self.variables]) for side in ("lower", "upper"))
        return np.clip(self.dilate(x, float(rng.uniform(*SLOWER))), lower, upper)


def instant(law: Array, place: float) -> float:
    """When a law ``(d + 1,)`` from 0 to 1, that never runs back, reaches a place, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        if basis(len(law) - 1, middle)[0] @ law < place:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
