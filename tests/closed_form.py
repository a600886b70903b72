"""Answers known without the package's solvers: closed forms, and recomputation with NumPy and scipy."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import sqrt
from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.formulation.objective import Objective, gauss
from ocp_traj.formulation.problem import Problem, Variable
from ocp_traj.formulation.requirements import SWEEP, PathConstraint, PointConstraint, Requirements, State
from ocp_traj.formulation.rows import Row
from ocp_traj.transcription.nlp import NLP

GAUSS = gauss(4)  # exact to degree 7


# --- one joint, rest to rest, by a quintic: q = D (10 u^3 - 15 u^4 + 6 u^5), u = t/T ---


@dataclass(frozen=True)
class Quintic:
    """One joint moved by D at rest to rest; everything about it has a closed form in T."""

    distance: float = 1.0  # D [rad]
    velocity: float = 2.0  # [rad/s]
    acceleration: float = 5.0  # [rad/s^2]

    @property
    def least_time(self) -> float:
        """Peak velocity 15/8 D/T at u = 1/2, peak acceleration 10/sqrt(3) D/T^2 at u = (3 -+ sqrt(3))/6."""
        return max(
            15.0 / 8.0 * self.distance / self.velocity, sqrt(10.0 / sqrt(3.0) * self.distance / self.acceleration)
        )

    @property
    def effort_constant(self) -> float:
        """int a^2 dt = 120/7 D^2 / T^3."""
        return 120.0 / 7.0 * self.distance**2


def quintic_problem(case: Quintic | None = None, velocity_limit: str = "velocity-limit") -> Problem:
    """The quintic as a problem of one variable T, with the objectives time, effort and mean speed (to be maximised)."""
    case = case or Quintic()
    ends = np.array([0.0] * 3 + [case.distance] * 3)[:, None]
    limits = (
        PathConstraint.on_derivative(velocity_limit, 1, -case.velocity, case.velocity, ("rad/s",), ("j",)),
        PathConstraint.on_derivative(
            "acceleration-limit", 2, -case.acceleration, case.acceleration, ("rad/s2",), ("j",)
        ),
    )
    return Problem(
        id="quintic",
        case=case,
        variables=(Variable("T", np.array([0.1]), np.array([10.0]), "s", ("T",)),),
        curve=lambda x: PiecewiseBezier(x[0], (ca.SX(ends),)),
        objectives=(
            Objective("time", "s", 2.0, of_variables=lambda x, p: x[0]),
            Objective("effort", "rad2/s3", 10.0, integrand=lambda s: ca.sumsqr(s.a), quadrature=GAUSS),
            Objective("speed", "rad/s", 0.5, sense="max", of_variables=lambda x, p: case.distance / x[0]),
            Objective("both", "-", 1.0, terms={"time": 0.5, "effort": 0.1}),
        ),
        default_objective="time",
        reference_point={"time": 4.0, "effort": 100.0},
        requirements=Requirements(("j",), ("rad",), limits),
        guess=lambda rng: rng.uniform(0.3, 8.0, 1),
        dilate=lambda x, s: np.asarray(x) * s,
    )


# --- several variables ---


@dataclass(frozen=True)
class Septic:
    """One joint moved by D in T, degree 7, rest to rest: without limits the least int jerk^2 dt is the quintic's."""

    distance: float = 0.7  # [rad]
    duration: float = 1.3  # [s]

    @property
    def optimum(self) -> tuple[Array, float]:
        """The two free control points (the quintic's, twice elevated) and int jerk^2 dt = 720 D^2/T^5."""
        points = np.array([0.0] * 3 + [1.0] * 3)
        for n in (5, 6):  # Farin (2002), sect. 6.1
            share = np.arange(n + 2) / (n + 1)
            points = share * np.append(0.0, points) + (1 - share) * np.append(points, 0.0)
        return points[3:5] * self.distance, 720.0 * self.distance**2 / self.duration**5


def septic_problem(case: Septic | None = None) -> Problem:
    """Control points P_3 and P_4 are free; a point constraint may be added by the tests."""
    case = case or Septic()

    def curve(x: Any) -> PiecewiseBezier:
        return PiecewiseBezier(np.array([case.duration]), (ca.vertcat(0, 0, 0, x, *[case.distance] * 3),))

    return Problem(
        id="septic",
        case=case,
        variables=(Variable("P", np.full(2, -5.0), np.full(2, 5.0), "rad", ("P3", "P4")),),
        curve=curve,
        objectives=(Objective("jerk", "rad2/s5", 10.0, integrand=lambda s: s.jerk**2, quadrature=gauss(8)),),
        default_objective="jerk",
        requirements=Requirements(
            ("j",), ("rad",), (PathConstraint.on_derivative("position-limit", 0, -5.0, 5.0, ("rad",), ("j",)),)
        ),
        guess=lambda rng: rng.uniform(-2.0, 2.0, 2),
    )


# Exact to degree 15: the squared jerk of a septic has degree 8.


@dataclass(frozen=True)
class Stairs:
    """Two quintics one after the other, in T1 and T2, to be traded against each other's effort."""

    first: float = 1.0  # D1 [rad]
    second: float = 2.0  # D2 [rad]


def stairs_problem(case: Stairs | None = None) -> Problem:
    """Objectives T1 + T2, c D1^2/T1^3 and c D2^2/T2^3: every (T1, T2) is Pareto-optimal."""
    case = case or Stairs()
    d1, d2 = case.first, case.second
    points = [np.array([0.0] * 3 + [d1] * 3)[:, None], np.array([d1] * 3 + [d1 + d2] * 3)[:, None]]
    constant = 120.0 / 7.0
    return Problem(
        id="stairs",
        case=case,
        variables=(Variable("T", np.full(2, 0.5), np.full(2, 6.0), "s", ("T1", "T2")),),
        curve=lambda x: PiecewiseBezier(x, tuple(ca.SX(p) for p in points)),
        objectives=(
            Objective("time", "s", 2.0, of_variables=lambda x, p: x[0] + x[1]),
            Objective("first", "rad2/s3", 5.0, of_variables=lambda x, p: constant * d1**2 / x[0] ** 3),
            Objective("second", "rad2/s3", 9.0, of_variables=lambda x, p: constant * d2**2 / x[1] ** 3),
        ),
        default_objective="time",
        reference_point={"time": 8.0, "first": 50.0, "second": 60.0},
        requirements=Requirements(
            ("j",),
            ("rad",),
            (PathConstraint.on_derivative("velocity-limit", 1, -8.0, 8.0, ("rad/s",), ("j",)),),
            continuity=2,
        ),  # fmt: skip
        guess=lambda rng: rng.uniform(0.8, 4.0, 2),
        dilate=lambda x, s: np.asarray(x) * s,
    )


@dataclass(frozen=True)
class Mixed:
    """Numbers of the problem below."""

    rate: float = 3.0
    steps: tuple[float, ...] = (1.0, 2.0)


def mixed_problem(case: Mixed | None = None) -> Problem:
    """Two joints on segments of degrees 5, 3 and 4 that jump at the knots; every kind of limit and objective.

    x holds the three durations, a parameter p, and two control points; limits see p, u and constants per segment.
    """
    case = case or Mixed()
    rng = np.random.default_rng(42)
    points = [rng.normal(size=(n + 1, 2)) for n in (5, 3, 4)]

    def curve(x: Any) -> PiecewiseBezier:
        first = ca.vertcat(ca.SX(points[0][:2]), ca.horzcat(x[4], x[5]), ca.SX(points[0][3:]))
        last = ca.SX(points[2]) * x[4]
        return PiecewiseBezier(x[:3], (first, ca.SX(points[1]), last))

    constants = np.arange(6.0).reshape(3, 2)
    limits = (
        PathConstraint.on_derivative("jerk-limit", 3, -50.0, [60.0, np.inf], ("m/s3",) * 2, ("a", "b")),
        PathConstraint(
            "odd",
            lambda s: ca.vertcat(s.c[0] * s.q[0] + s.p[0] * s.v[1], s.c[1] + s.u * s.snap[0], s.a[1] * s.jerk[0]),
            np.array([-5.0, -np.inf, -40.0]),
            np.array([5.0, 30.0, 70.0]),
            ("m", "m/s4", "m2/s5"),
            ("one", "two", "three"),
            constants=constants,
        ),
        PathConstraint("smooth", lambda s: s.q[0] ** 2 + s.q[1] ** 2, -np.inf, 9.0, ("m2",), ("r2",)),
    )
    objectives = (
        Objective("time", "s", of_variables=lambda x, p: x[0] + x[1] + x[2] + p[0]),
        Objective("area", "m2 s", integrand=lambda s: s.q[0] ** 2 * s.p[0], quadrature=((0.0, 0.5), (1.0, 0.5))),
        Objective("rough", "m2/s5", 100.0, integrand=lambda s: ca.sumsqr(s.jerk), quadrature=GAUSS),
        Objective("trapezoid", "m2/s3", integrand=lambda s: ca.sumsqr(s.a), quadrature=((0.0, 0.5), (1.0, 0.5))),
        Objective("sum", "-", terms={"time": 2.0, "rough": -0.5}),
    )
    return Problem(
        id="mixed",
        case=case,
        variables=(
            Variable("T", np.full(3, 0.3), np.full(3, 4.0), "s", ("T1", "T2", "T3")),
            Variable("rest", np.full(3, -2.0), np.full(3, 2.0), "m", ("p", "x", "y")),
        ),
        curve=curve,
        parameters=lambda x: x[3] * case.rate,
        objectives=objectives,
        default_objective="time",
        requirements=Requirements(("a", "b"), ("m", "m"), limits, (), ("p",), continuity=0),
        guess=lambda rng: np.concatenate([rng.uniform(0.5, 2.0, 3), rng.uniform(-1.0, 1.0, 3)]),
    )


class Direct:
    """A problem's objectives and limits as they are written: their expressions on numbers, at one decision vector."""

    def __init__(self, problem: Problem, x: Array) -> None:
        symbol = ca.SX.sym("x", problem.size)
        curve = problem.curve(symbol)
        outputs = [ca.densify(ca.SX(o)) for o in (problem.parameters(symbol), curve.durations, *curve.control_points)]
        p, durations, *points = (np.array(o) for o in ca.Function("curve", [symbol], outputs)(x))
        self.problem, self.x, self.p = problem, x, p.ravel()
        self._compiled: dict[Any, Any] = {}
        # Each segment over [0, T_k], by scipy.
        self.segments = [BPoly(p[:, None, :], [0.0, T]) for p, T in zip(points, durations.ravel(), strict=True)]

    def value(
        self, expression: Callable[[State], Any], k: int, u: float, constants: Array, sweep: float | None = None
    ) -> Array:
        """An expression of the state at local time u of segment k, and at a place along the sweep of a swept limit."""
        curve = self.segments[k]
        t = u * curve.x[-1]
        derivatives = [curve.derivative(order)(t) if order else curve(t) for order in range(5)]
        numbers = [*derivatives, u, self.p, constants, *([] if sweep is None else [sweep])]
        if expression not in self._compiled:
            state = State(*(ca.SX.sym(name, np.size(n)) for name, n in zip(State._fields, numbers, strict=False)))
            self._compiled[expression] = ca.Function(
                "f", [part for part in state if part is not None], [ca.densify(ca.SX(expression(state)))]
            )
        return np.array(self._compiled[expression](*numbers)).ravel()

    def objective(self, name: str) -> float:
        """An objective, its quadrature rule as a sum."""
        objective = self.problem.objective(name)
        if objective.terms is not None:
            return sum(factor * self.objective(term) for term, factor in objective.terms.items())
        if objective.of_variables is not None:
            return float(ca.evalf(ca.SX(objective.of_variables(ca.DM(self.x), ca.DM(self.p)))))
        total = 0.0
        if objective.variation is not None:
            for k in range(len(self.segments)):
                for row, inner in enumerate(self.turning_points(objective, k)):
                    nodes = [0.0, *inner, 1.0]
                    values = [self.value(objective.variation, k, u, np.zeros(0))[row] for u in nodes]
                    total += float(np.abs(np.diff(values)).sum())
            return total
        assert objective.integrand is not None
        for k, curve in enumerate(self.segments):
            for u, weight in objective.quadrature:
                total += curve.x[-1] * weight * float(self.value(objective.integrand, k, u, np.zeros(0))[0])
        return total

    def turning_points(self, objective: Objective, k: int) -> list[list[float]]:
        """Local times at which each row of a total variation may turn back on segment k, in order.

        A row is a polynomial of the curve's degree: numpy interpolates it and finds its derivative's roots. The real
        part of a complex root is a node too many, which does no harm to a sum of steps.
        """
        assert objective.variation is not None
        degree = self.segments[k].c.shape[0] - 1
        u = 0.5 - 0.5 * np.cos(np.pi * np.arange(degree + 1) / degree)
        samples = np.array([self.value(objective.variation, k, float(place), np.zeros(0)) for place in u])
        found = []
        for row in samples.T:
            derivative = np.polynomial.Polynomial.fit(u, row, degree, domain=[0.0, 1.0]).deriv()
            found.append(sorted(float(r) for r in derivative.roots().real if 0.0 < r < 1.0))
        return found

    def limit(self, limit: PathConstraint | PointConstraint, k: int, u: float) -> Array:
        """A limit at local time u of segment k: ``(rows,)``."""
        table = getattr(limit, "constants", None)
        return self.value(limit.expression, k, u, np.zeros(0) if table is None else table[k])

    def excess(self, limit: PathConstraint, instants: Iterable[float], both_sides: bool = True) -> Array:
        """Largest excess of each row over its bounds at instants of every segment, in units of the limit's scale."""
        last = len(self.segments) - 1
        held = [k for k in range(last + 1) if limit.holds_on(k)]
        grid = [(k, u) for k in held for u in instants if both_sides or u < 1.0 or k == last]
        if limit.sweep:  # looked at where a population looks
            table = limit.constants
            values = np.array(
                [
                    self.value(limit.expression, k, u, np.zeros(0) if table is None else table[k], float(s))
                    for k, u in grid
                    for s in SWEEP
                ]
            )
        else:
            values = np.array([self.limit(limit, k, u) for k, u in grid])
        return np.asarray(np.maximum(values - limit.upper, limit.lower - values).max(axis=0) / limit.scale)


def via_constraint(u: float, value: float) -> PointConstraint:
    """The position of a single-segment, single-joint curve at local time u."""
    return PointConstraint("via", lambda s: s.q, ((0, u),), np.array([value]), np.array([value]), ("rad",), ("j",))


# --- nonlinear programs ---


def small_nlp(
    n: int,
    f: Callable[[Any], Any],
    rows: Iterable[tuple[str, Callable[[Any], Any], float, float]] = (),
    lower: float | Array = -np.inf,
    upper: float | Array = np.inf,
    scale: float = 1.0,
) -> NLP:
    """An NLP of n variables from rows (name, g, lower, upper); ``scale`` is that of all rows."""
    x = ca.MX.sym("x", n)
    rows = list(rows)
    return NLP.symbolic(
        name="small",
        x=x,
        f=f(x),
        g=ca.vertcat(*(g(x) for _, g, _, _ in rows)) if rows else ca.MX(0, 1),
        lower_x=np.broadcast_to(np.asarray(lower, dtype=float), (n,)).copy(),
        upper_x=np.broadcast_to(np.asarray(upper, dtype=float), (n,)).copy(),
        lower_g=np.array([low for _, _, low, _ in rows], dtype=float),
        upper_g=np.array([high for _, _, _, high in rows], dtype=float),
        rows=tuple(Row(name, "", unit="m", scale=scale) for name, _, _, _ in rows),
        labels=tuple(f"x{i}" for i in range(n)),
        units=("m",) * n,
    )


# --- the spline of Guo et al. (2016), by scipy ---


def clamped_spline(via_points: Array, h: Array) -> CubicSpline:
    """scipy's clamped spline through via points and two free knots, these such that the end accelerations vanish.

    The spline is linear in its knots' positions, so the two free ones solve two equations.
    """
    t = np.concatenate([[0.0], np.cumsum(h)])
    free = [1, len(t) - 2]
    fixed = [i for i in range(len(t)) if i not in free]
    knots = np.zeros((len(t), via_points.shape[1]))
    knots[fixed] = via_points
    units = np.eye(len(t))[:, free]
    response = CubicSpline(t, units, bc_type="clamped")(t[[0, -1]], 2)
    plain = CubicSpline(t, knots, bc_type="clamped")(t[[0, -1]], 2)
    knots[free] = -np.linalg.solve(response, plain)
    return CubicSpline(t, knots, bc_type="clamped")
