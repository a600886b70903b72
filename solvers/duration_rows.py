"""Rows of limits over the ratios of durations: those that scale with time as bounds of the time, and the others."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS, PathConstraint
from ocp_traj.interval.tape import Tape
from ocp_traj.proof.values import limit_on
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.solvers.interval_forms import Pair, mean_value, product

SAMPLES = 13  # instants a segment among which a box's peaks are looked for: our choice; two refinements follow
NEAR = 0.02  # of a limit's scale: rows that do not scale and come this close at the solution take part; our choice
DOWN = 1.0 - 1e-14  # factor that makes a positive float, a few roundings off, a lower bound


def scaling_limits(problem: Problem) -> list[PathConstraint]:
    """The limits on derivatives of the joints, which slow motion relaxes."""
    limits = [c for c in problem.requirements.path_constraints if c.order is not None and c.order >= 1]
    return [c for c in limits if (c.lower < 0.0).all() and (c.upper > 0.0).all()]


def peaks_of(values: Callable[[Array], Array], rows: int, count: int) -> Array:
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


class ScalingRows:
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
        self._shortest, self._longest = problem.lower[:, None], problem.upper[:, None]
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

        return peaks_of(scaled, self.count, z.shape[1])

    def times_over(self, box: Pair, centre: Array, u: Array) -> tuple[Array, Array]:
        """Times that no motion with ratios in a box is shorter than, and longer than.

        Args:
            box: ends ``(n - 1, N)`` each.
            centre: a point of each box ``(n - 1, N)``.
            u: instants at which the rows are looked at ``(rows, N)``: any will do, the peaks at the centre do best.

        Returns:
            ``(N,)`` each; the first is the larger one where no motion is within the bounds of the durations.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            scaled = mean_value(self.value, self.slopes, box, centre, u)[0]
            best = (np.maximum(scaled, 0.0) ** (1.0 / self.powers[:, None]) * DOWN).max(axis=0)
            shares = self.shares.enclose(box)[0]
            least = product(shares, (self._shortest, self._shortest))[0].max(axis=0)
            most = product(shares, (self._longest, self._longest))[1].min(axis=0)
        return np.maximum(np.where(np.isnan(best), 0.0, best), least), most


class OtherRows:
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

        return peaks_of(excess, self.count, y.shape[1])


def near_rows(problem: Problem, candidate: Trajectory, share: float = NEAR) -> list[tuple[str, int, int, int]]:
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

                if np.isfinite(bound) and signed(peaks_of(signed, 1, 1)).max() > bound - share * limit.scale[row]:
                    found.append((limit.id, row, k, side))
    return found
