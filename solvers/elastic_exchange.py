"""By how much limits have to give for a trajectory to meet them between instants too: exchange, elastic."""

from __future__ import annotations

from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.rows import Conflict
from ocp_traj.formulation.scalarise import Scalarisation
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import frozen
from ocp_traj.transcription.transcription import transcribe
from ocp_traj.transcription.worst_instants import worst_instants

MOST, SAME = 8, 1e-4  # rounds, and the relative change of amounts that ends them: our choice


def amounts_to_give(problem: Problem, scalarisation: Scalarisation, solution: Solution) -> tuple[Conflict, ...]:
    """The limits in conflict at the least-violating trajectory found from a locally infeasible solution.

    Peaks above a bound become instants of the elastic problem until the amounts change by less than ``SAME``, or for
    ``MOST`` rounds. With so much more the trajectory would meet every limit at the instants of the last round, to the
    solver's tolerance. Between them, where its peaks have moved since, it may need more: to first order in that move
    nothing, for a peak is flat. So limits raised by just these amounts may still not hold together. Nothing of this is
    proved, and another trajectory, farther away, may need less.

    Args:
        problem: whose limits.
        scalarisation: whose bounds on objectives may be in conflict as well.
        solution: with the instants of its last NLP.

    Returns:
        Those of the solution where the elastic problem is not solved.
    """
    conflicts, instants, x = solution.conflicts, list(solution.instants), solution.x[: problem.size]
    solver = Ipopt(1e-8)
    for _ in range(MOST):
        instants = [frozen(instant, x) for instant in instants]
        nlp = transcribe(problem, scalarisation, instants)
        found = solver.least_violation(nlp, nlp.start(x))
        if found is None:
            break
        before, conflicts, x = conflicts, found[0].conflicts(found[1]), found[1].x[: problem.size]
        if _alike(before, conflicts):
            break
        peaks, _ = worst_instants(problem, x, 0.0)
        if not peaks:
            break
        instants += peaks
    return conflicts


def _alike(before: tuple[Conflict, ...], after: tuple[Conflict, ...]) -> bool:
    one, two = ({(c.row.limit, c.row.label): c.excess for c in some if c.excess > 0.0} for some in (before, after))
    return one.keys() == two.keys() and all(abs(one[key] - two[key]) <= SAME * two[key] for key in two)
