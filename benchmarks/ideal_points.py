"""Ideal points of the problems.

python benchmarks/ideal_points.py PROBLEM [FIELD=VALUE ..] [--seeds N]


The ideal of an objective is the best value that it takes at an end of any front of two objectives within the reference
point: itself minimised from several seeds, one other at a time held within its reference. What is printed is rounded to
six digits towards the better, and stands in ``Problem.ideal_point``.
"""

import argparse
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

from ocp_traj import problems
from ocp_traj.problem import Problem
from ocp_traj.scalarise import EpsilonConstraint
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.multistart import Multistart


def best(problem: Problem, name: str, other: str, seeds: int) -> float | None:
    """The best proved value of an objective with another within its reference, over all alternatives and seeds."""
    scalar = EpsilonConstraint(name, {other: problem.reference_point[other]})
    values = [
        solution.objectives[name]
        for alternative in (problem.alternatives or {"": problem}).values()
        for seed in range(seeds)
        for solution in Multistart(Exchange(), max(2, problem.starts), seed).solve_all(alternative, scalar)
        if solution.audit is not None and solution.audit.proved
    ]
    choose = min if problem.objective(name).sense == "min" else max
    return choose(values) if values else None


def main() -> None:
    """Prints the ideal point of a case, and what each other objective leaves of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problem", choices=problems.names())
    parser.add_argument("case", nargs="*", metavar="FIELD=VALUE")
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args()
    problem = problems.load(given.problem, **dict(text.split("=", 1) for text in given.case))
    ideal = {}
    for name in problem.reference_point:
        ends = {other: best(problem, name, other, given.seeds) for other in problem.reference_point if other != name}
        print(name, {other: value and float(f"{value:.9g}") for other, value in ends.items()}, flush=True)
        found = [value for value in ends.values() if value is not None]
        least = problem.objective(name).sense == "min"
        rounding = Context(prec=6, rounding=ROUND_FLOOR if least else ROUND_CEILING)
        if found:
            ideal[name] = float(rounding.create_decimal_from_float(min(found) if least else max(found)))
    print("ideal_point", ideal)


if __name__ == "__main__":
    main()
