"""Ends of the problems' fronts, from which their ideal points follow.

python benchmarks/ideal_points.py PROBLEM [FIELD=VALUE ..] [--seeds N]

The ends of a front of two objectives: each minimised from several seeds, with the other held within its reference or
found to be there. What is printed is rounded to six digits towards the better, and stands in ``Problem.best_values``.
"""

import argparse

from ocp_traj import problems
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import EpsilonConstraint
from ocp_traj.rounding import rounded_down, rounded_up
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart

DIGITS = 6
WITHIN = 1e-6  # relative, by which a solution on a reference may be beyond it: our choice


def best_values(problem: Problem, name: str, seeds: int) -> dict[str, float]:
    """The best proved value of an objective with each other one within its reference, over alternatives and seeds."""
    reference = problem.reference_point
    others = [other for other in reference if other != name]
    scalars = [EpsilonConstraint(name, {}), *(EpsilonConstraint(name, {o: reference[o]}) for o in others)]
    found = [
        solution.objectives
        for alternative in (problem.alternatives or {"": problem}).values()
        for scalar in scalars
        for seed in range(seeds)
        for solution in Multistart(Exchange(), max(2, problem.tuning.starts), seed).solve_all(alternative, scalar)
        if solution.audit is not None and solution.audit.proved
    ]
    signs = {n: 1.0 if problem.objective(n).sense == "min" else -1.0 for n in reference}
    towards_better = rounded_down if signs[name] > 0.0 else rounded_up
    best = {}
    for other in others:
        room = signs[other] * reference[other] + WITHIN * abs(reference[other])
        values = [signs[name] * values[name] for values in found if signs[other] * values[other] <= room]
        if values:
            best[other] = towards_better(signs[name] * min(values), DIGITS)
    return best


def main() -> None:
    """Prints the best values of each objective of a case."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problem", choices=problems.names())
    parser.add_argument("case", nargs="*", metavar="FIELD=VALUE")
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    problem = problems.load(given.problem, **dict(text.split("=", 1) for text in given.case))
    for name in problem.reference_point:
        print(f'"{name}": {best_values(problem, name, given.seeds)},', flush=True)


if __name__ == "__main__":
    main()
