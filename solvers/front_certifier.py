"""A certified front: how much of two objectives that scale with time no trajectory can add to its proved points.

It applies where ``BranchAndBound`` does, to problems whose variables are durations and whose path depends on their
ratios alone, and there to an objective that grows with time and one that falls with it or stays, each a power of time
along a path: time against squared jerk, which falls as T^-5, is one. The exponents follow from the objectives' own
operations (``ocp_traj.transcription.time_degrees``). The bound is by ``front_search``, in outward-rounded intervals:
nothing in it is sampled. It takes the limits on derivatives of joints and the bounds of durations into account; other
limits can only take trajectories away, so it holds with them, but need not be close.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import moocore
import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.verdicts import PROVED
from ocp_traj.results.front import Front, Point
from ocp_traj.results.front_certificate import FrontCertificate
from ocp_traj.solvers.branch_and_bound import ratios_obstacle
from ocp_traj.solvers.duration_rows import scaling_limits
from ocp_traj.solvers.front_search import FrontRows, FrontSearch
from ocp_traj.stopping import stopping
from ocp_traj.transcription.time_degrees import time_degree

SLACK = 0.05  # of the tolerance: the room left below the front at which the search ends; our choice
LEAST = 1e-3  # of that room: what a box has to leave to be worth cutting; our choice
MARGIN = 0.25  # of the range from the front's first point to the reference: how far before it the cells begin, ..
NEAREST = 0.1  # .. and no nearer to zero than this share of that point: our choices
ROUNDING = 1e-12  # relative: of volumes, sums of thousands of terms above zero


@dataclass(frozen=True)
class FrontCertifier:
    """Certifies fronts of two objectives.

    Attributes:
        tolerance: gap in hypervolume that counts as certified.
        max_boxes: stop after so many.
        max_seconds: stop after this time.
        progress: told after each pass.
    """

    tolerance: float = 0.01
    max_boxes: int = 200_000
    max_seconds: float = 60.0
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Checks the tolerance."""
        if not 0.0 < self.tolerance < 1.0:
            raise InputError(f"the gap that counts as certified is {self.tolerance}; give a number between 0 and 1")

    @one_blas_thread
    def certify(self, front: Front, reference: Point | None = None) -> Front:
        """The front with its certificate, whatever the gap is. Ctrl-C ends it early, with what holds by then.

        Args:
            front: whose proved points count.
            reference: worst values worth having, per objective; by default the problem's reference point.
        """
        problem, begun = front.problem, time.perf_counter()
        require_front_certifiable(problem, front.objectives)
        names = _ordered(problem, front.objectives)
        corner = front.hypervolume(reference).reference
        worst = np.array([corner[name] for name in names])
        attained = _corners(front, names, worst)
        if not worst[0] > 0.0:
            raise InputError(f"{problem.id}: the reference of {names[0]} is {worst[0]:g}; a bound needs one above zero")
        volume = float(moocore.hypervolume(attained, ref=worst)) * (1.0 - ROUNDING) if len(attained) else 0.0
        first, rows = max(float(attained[:1, 0].sum()), NEAREST * float(worst[0])), FrontRows(problem, names)
        begin = max(first - MARGIN * (float(worst[0]) - first), NEAREST * first)
        search = FrontSearch(problem, rows, (begin, float(worst[0])), float(worst[1]), volume or 1.0)
        aim = SLACK * self.tolerance
        with stopping(self.max_seconds) as stop:
            while search.open and search.boxes < self.max_boxes and not stop.due and search.room() > aim:
                search.step(aim * LEAST)
                self.progress(
                    search.boxes, 0, f"{len(search.low)} boxes open, {search.room():.2e} left below the front"
                )
            stop.tell()
        bound, most = _staircase(search)
        certificate = FrontCertificate(
            objectives=names,
            units=(problem.objective(names[0]).unit, problem.objective(names[1]).unit),
            bound=bound,
            attained=attained,
            reference={name: float(corner[name]) for name in names},
            volume=volume,
            most=most,
            tolerance=self.tolerance,
            boxes=search.boxes,
            seconds=time.perf_counter() - begun,
            left_out=_left_out(problem),
        )
        return replace(front, certificate=certificate)


def require_front_certifiable(problem: Problem, objectives: Sequence[str]) -> None:
    """Raises ``InputError`` where no bound of a whole front is known."""
    obstacle = _obstacle(problem, objectives)
    if obstacle is not None:
        raise InputError(f"{problem.id}: a front of {', '.join(objectives)} cannot be certified: {obstacle}")


def _obstacle(problem: Problem, objectives: Sequence[str]) -> str | None:
    if problem.alternatives:
        return f"it leaves a choice open, {', '.join(problem.alternatives)}, and a bound is of one of them"
    obstacle = ratios_obstacle(problem)
    if obstacle is not None:
        return obstacle
    if len(set(objectives)) != 2:
        return "give two objectives"
    degrees = {}
    for name in objectives:
        objective, degree = problem.objective(name), time_degree(problem, name)
        if objective.sense != "min":
            return f"{name} is made large, and only what is made small is bounded"
        if degree is None:
            return f"{name} is no power of time along a path, as far as its operations show"
        degrees[name] = degree
    if not (max(degrees.values()) > 0 >= min(degrees.values())):
        words = ", ".join(f"{name} as T^{degree}" for name, degree in degrees.items())
        return f"one objective has to grow with time and the other not; they go as {words}"
    return None


def _ordered(problem: Problem, objectives: Sequence[str]) -> tuple[str, str]:
    """The objective that grows with time, then the other."""
    first, second = objectives
    return (first, second) if (time_degree(problem, first) or 0) > 0 else (second, first)


def _corners(front: Front, names: tuple[str, str], worst: Array) -> Array:
    """The proved points within the reference that no other one dominates, ascending in the first objective."""
    proved = [point.objectives for point in front.points if point.verdict == PROVED]
    values = np.array([[one[name] for name in names] for one in proved], dtype=float).reshape(-1, 2)
    values = values[(values < worst).all(axis=1)]
    values = values[moocore.is_nondominated(values)] if len(values) else values
    return np.asarray(values[np.argsort(values[:, 0])])


def _staircase(search: FrontSearch) -> tuple[Array, float]:
    """Corners of the lower staircase where it is below the reference, and the volume above it, rounded up."""
    lower, edges, start = np.minimum.accumulate(search.lower), search.edges, search.start
    begins = np.maximum(edges[:-1], start)
    widths = np.maximum(edges[1:] - begins, 0.0)
    most = float(widths @ (search.worst - lower)) * (1.0 + ROUNDING) if start > edges[0] else np.inf
    falls = np.append(True, lower[1:] < lower[:-1]) & (lower < search.worst)
    return np.column_stack([begins[falls], lower[falls]]), most


def _left_out(problem: Problem) -> tuple[str, ...]:
    """Limits at every instant and of durations that are no limits on derivatives of the joints."""
    needs, counted = problem.requirements, [limit.id for limit in scaling_limits(problem)]
    names = [limit.id for limit in needs.path_constraints if limit.id not in counted]
    names += [limit.id for limit in needs.duration_constraints] + [limit.id for limit in needs.clearance_constraints]
    return tuple(names)
