"""The largest payload (DLCC): along a given trajectory, over all trajectories within a time, and for every time law.

Guo et al. (2016), sect. 5, raise the mass along an optimised trajectory until an effort reaches its limit. Here the
mass is bracketed by proofs: the payload reported is one whose trajectory was proved, the next one up is not. The joint
problem makes the mass a decision variable. The static bound needs no trajectory: where position, velocity and
acceleration are given, at the ends of a rest-to-rest motion, efforts depend on the mass alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, NoSolutionFound
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint, WeightedSum
from ocp_traj.progress import Progress, silent
from ocp_traj.proof.audit import audit_all
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.solvers.by_levels import ByLevels
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.solvers.protocols import ProblemSolver
from ocp_traj.stopping import STOPS, current, stopping
from ocp_traj.transcription.end_states import fixed_values

PARAMETER = "payload"
OBJECTIVE = "payload_mass"
TOLERANCE = 1e-6  # [kg] between the payload that is proved and the one that is not: our choice
BATCH = 16  # masses audited together


@dataclass(frozen=True, eq=False)
class LargestPayload:
    """A largest payload and what stops it.

    Attributes:
        payload: [kg].
        binding: limit and label that stop it.
        instant: when [s]; 0 or the end for the static bound.
        kind: ``every time law``, ``along a trajectory`` or ``within a time``.
        value, bound, unit: of the binding limit at this payload.
        argument: why, in one sentence.
        trajectory, audit: the one that carries it, where there is one.
        solution: of the joint problem.
    """

    payload: float
    binding: str
    instant: float
    kind: str
    value: float
    bound: float
    unit: str
    argument: str
    trajectory: Trajectory | None = None
    audit: Audit | None = None
    solution: Solution | None = field(default=None, repr=False)


def _parameter_index(problem: Problem) -> int:
    if PARAMETER not in problem.requirements.parameters:
        raise InputError(f"{problem.id} has no payload; its parameters are {list(problem.requirements.parameters)}")
    return problem.requirements.parameters.index(PARAMETER)


@one_blas_thread
def static_bound(problem: Problem) -> LargestPayload:
    """The payload no time law can exceed, from the efforts at the ends, where the motion is given.

    A row v(m) = v(0) + m (v(1) - v(0)) meets its bound at one mass; the smallest of them is the bound.
    """
    index, count = _parameter_index(problem), len(problem.requirements.parameters)
    best: LargestPayload | None = None
    for fixed in fixed_values(problem):
        masses = [np.eye(count)[index] * m for m in (0.0, 1.0, 2.0)]
        at_rest, one, two = (float(fixed.value(p)) for p in masses)
        slope = one - at_rest
        if abs(slope) <= 1e-12 * max(1.0, abs(at_rest)):
            continue
        if abs(two - one - slope) > 1e-9 * max(1.0, abs(two)):
            raise InputError(
                f"limit {fixed.limit.id!r} is not linear in the payload; its static bound has no closed form"
            )
        bound = float(fixed.limit.upper[fixed.row] if slope > 0.0 else fixed.limit.lower[fixed.row])
        mass = (bound - at_rest) / slope
        if np.isfinite(mass) and (best is None or mass < best.payload):
            name, unit = f"{fixed.limit.id} {fixed.limit.labels[fixed.row]}", fixed.limit.units[fixed.row]
            end = "start" if fixed.segment == 0 and fixed.instant == 0.0 else "end"
            argument = (
                f"at the {end} position, velocity and acceleration are given, so {name} is {at_rest:.6g} {unit} "
                f"{slope:+.6g} {unit}/kg whatever the time law, and may reach {bound:.6g} {unit}"
            )
            best = LargestPayload(mass, name, 0.0, "every time law", bound, bound, unit, argument)
    if best is None:
        raise InputError(f"{problem.id}: no limit at its ends depends on the payload alone; there is no static bound")
    return best


@one_blas_thread
def along(problem: Problem, trajectory: Trajectory, largest: float | None = None) -> LargestPayload:
    """The largest payload along a trajectory whose timing stays as it is, bracketed by proofs to ``TOLERANCE``.

    Args:
        problem: whose limits; its payload is a parameter of the trajectory.
        trajectory: any that meets the limits with some payload between zero and its own.
        largest: where to stop looking [kg]; the static bound, if there is one, else 1000 kg.
    """
    _parameter_index(problem)
    top = 1000.0 if largest is None else largest

    def audits(masses: Sequence[float] | Array) -> list[Audit]:
        loaded = [replace(trajectory, parameters={**trajectory.parameters, PARAMETER: float(m)}) for m in masses]
        return audit_all(loaded, problem.requirements)

    own = float(trajectory.parameters.get(PARAMETER, 0.0))
    proved = next((m for m, a in zip((own, 0.0), audits([own, 0.0]), strict=True) if a.proved), None)
    if proved is None:
        raise NoSolutionFound(
            f"{problem.id}: the trajectory breaks its limits with its own payload ({own:g} kg) and with none: "
            f"{audits([0.0])[0].explain()}"
        )
    low, high, above = proved, top, audits([top])[0]
    if above.proved:
        raise InputError(
            f"{problem.id}: even {top:g} kg are proved along this trajectory; give a larger mass to look up to"
        )
    while high - low > TOLERANCE:
        current().check()
        masses = np.linspace(low, high, BATCH + 2)[1:-1]
        found = audits(masses)
        first = next((i for i, a in enumerate(found) if not a.proved), len(found))
        if first < len(found):
            high, above = float(masses[first]), found[first]
        if first > 0:
            low = float(masses[first - 1])
    carried = _carrying(problem, trajectory, low)
    row = above.failures[0]
    return LargestPayload(
        payload=low,
        binding=f"{row.limit} {row.label}",
        instant=row.instant,
        kind="along a trajectory",
        value=row.attained,
        bound=row.bound,
        unit=row.unit,
        argument=f"{low:.6f} kg are proved along the trajectory, {high:.6f} kg are not: {row.limit} {row.label} "
        f"reaches {row.attained:.6g} {row.unit} at t = {row.instant:.6g} s",
        trajectory=carried,
        audit=audits([low])[0],
    )


def _carrying(problem: Problem, trajectory: Trajectory, mass: float) -> Trajectory:
    """The trajectory with another payload [kg], in its case and its variables as well where they have one."""
    case, variables = dict(trajectory.case), dict(trajectory.variables)
    if hasattr(problem.case, PARAMETER):
        case[PARAMETER] = mass
    if PARAMETER in variables:
        variables[PARAMETER] = np.array([mass])
    parameters = {**trajectory.parameters, PARAMETER: mass}
    return replace(trajectory, case=case, variables=variables, parameters=parameters, origin=None)


@one_blas_thread
def within(
    problem: Problem, max_time: float, starts: Multistart | None = None, progress: Progress = silent
) -> LargestPayload:
    """The largest payload found of all trajectories that take at most ``max_time`` [s]: mass and motion together.

    Looked for from the shortest motion that is found, whose mass is free as well, and from random starts. It is of
    local solvers; the static bound, where there is one, says what no motion carries.

    Args:
        problem: with its payload freed, so that ``payload_mass`` is one of its objectives.
        max_time: [s].
        starts: of the joint problem.
        progress: told of each way.
    """
    if not (np.isfinite(max_time) and max_time > 0.0):
        raise InputError(f"the time allowed is {max_time} s; give a finite time above zero")
    problem.objective(OBJECTIVE)
    _require_dependence(problem)
    many = starts or Multistart(starts=2)
    solver: ProblemSolver = many if problem.levels is None else ByLevels(many)
    scalar = EpsilonConstraint(OBJECTIVE, {"time": max_time})
    found: list[Solution] = []
    with stopping() as stop:
        try:
            for number, way in enumerate((_from_shortest, _from_anywhere), 1):
                if not found or problem.levels is None:  # by levels the second finds no more, and takes long
                    found += way(problem, scalar, solver, many.solver)
                progress(number, 2, f"best {_best(found)} kg")
        except STOPS as reason:
            if not found:
                raise
            stop.take(reason)
        solution = best_of(found).require()
        if stop.tell():
            solution = replace(solution, interrupted=solution.interrupted or "before all ways were tried")
    assert solution.audit is not None and solution.trajectory is not None
    if not solution.audit.proved:
        raise NoSolutionFound(
            f"{problem.id}: the largest payload within {max_time:g} s was not proved; {solution.audit.explain()}"
        )
    payload, static = solution.objectives[OBJECTIVE], None
    try:
        static = static_bound(problem)
        known = f"no time law carries more than {static.payload:.6g} kg ({static.binding})"
        if payload >= static.payload - TOLERANCE:
            known += ", so it is the largest there is"
    except InputError:
        known = "how much more another motion carries is not known"
    name = "" if static is None else static.binding.split()[0]
    rows = [row for row in solution.audit.rows if row.verdict == "proved" and row.limit == name]
    tight = min(rows or solution.audit.rows, key=lambda row: row.margin)
    return LargestPayload(
        payload=payload,
        binding=f"{tight.limit} {tight.label}",
        instant=tight.instant,
        kind="within a time",
        value=tight.attained,
        bound=tight.bound,
        unit=tight.unit,
        argument=f"the largest found, mass and time law together, in at most {max_time:g} s; {known}",
        trajectory=solution.trajectory,
        audit=solution.audit,
        solution=solution,
    )


def _require_dependence(problem: Problem) -> None:
    """Refuses a problem in which no limit stops the payload."""
    index, requirements = _parameter_index(problem), problem.requirements
    limits = requirements.path_constraints
    if not any(index in requirements.function(limit).jac_sparsity(0, 2).get_triplet()[1] for limit in limits):
        raise InputError(f"{problem.id}: no limit depends on the payload, so there is no largest; limit the efforts")


def _from_shortest(problem: Problem, scalar: EpsilonConstraint, solver: ProblemSolver, one: Exchange) -> list[Solution]:
    """From the shortest motion, whose mass is free as well: inside the bound on time there is room for more."""
    shortest = solver.solve(problem, WeightedSum({"time": 1.0}))
    if not shortest.ok or shortest.objectives["time"] > scalar.bounds["time"]:
        return []
    origin = None if shortest.trajectory is None else shortest.trajectory.origin
    near = replace(one, solver=one.solver.near_start())
    return [near.solve(origin or problem, scalar, shortest.x)]


def _from_anywhere(problem: Problem, scalar: EpsilonConstraint, solver: ProblemSolver, one: Exchange) -> list[Solution]:
    """From random starts."""
    return [solver.solve(problem, scalar)]


def _best(found: Sequence[Solution]) -> str:
    values = [solution.objectives[OBJECTIVE] for solution in found if solution.ok]
    return f"{max(values):.6g}" if values else "no"
