"""Many starts: each depends on the seed and its own number alone, and the best proved one wins."""

from dataclasses import replace
from itertools import count
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj.api.solving import solve
from ocp_traj.arrays import Array
from ocp_traj.formulation.objective import Objective
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import PathConstraint
from ocp_traj.formulation.scalarise import EpsilonConstraint, Scalarisation, WeightedSum
from ocp_traj.formulation.tuning import Tuning
from ocp_traj.progress import Progress
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, Audit, AuditRow
from ocp_traj.results.solution import Solution
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.solvers.multistart import Multistart, best_of
from ocp_traj.transcription.nlp import NLP, NLPResult, Status
from tests.closed_form import Quintic, quintic_problem

TIME = WeightedSum({"time": 1.0})


def audit_of(verdict: str) -> Audit:
    return Audit((AuditRow("l", "j", "m", 1.0, 0.0, 0.0, 0.0, 0.1, verdict, 1),))


def solution(f: float, status: Status = Status.SOLVED, verdict: str | None = PROVED) -> Solution:
    return Solution("p", np.array([f]), f, status, 0.0, 1, 0.0, audit=None if verdict is None else audit_of(verdict))


def missing(f: float, violation: float) -> Solution:
    return replace(solution(f, Status.LOCALLY_INFEASIBLE, None), violation=violation)


# --- starting points ---


def test_starts_are_a_prefix_of_more_starts(hybrid: Problem) -> None:
    few, many = (Multistart(starts=n, seed=7).points(hybrid) for n in (3, 8))
    assert len(many) == 8
    assert_array_equal(few, many[:3])


def test_starts_differ_from_each_other_and_between_seeds(hybrid: Problem) -> None:
    points = np.concatenate([Multistart(starts=5, seed=s).points(hybrid) for s in (0, 1, 2)])
    assert len(np.unique(points, axis=0)) == 15


def test_starts_do_not_depend_on_numpys_global_state(hybrid: Problem) -> None:
    np.random.seed(1)
    one = Multistart(starts=2, seed=3).points(hybrid)
    np.random.seed(2)
    assert_array_equal(one, Multistart(starts=2, seed=3).points(hybrid))


def test_like_points_are_one_start() -> None:
    problem = replace(quintic_problem(), guess=lambda rng: np.array([2.0]))
    assert len(Multistart(starts=5, seed=0).points(problem)) == 1


# --- solving ---


def test_a_warm_start_objective_is_solved_first_and_once() -> None:
    """What follows begins at its optimum, whatever the guess was."""
    problem = replace(quintic_problem(), tuning=Tuning(warm_start_objective="effort"))
    plain = quintic_problem()
    begun: list[float] = []

    class Watched(Exchange):
        def solve(
            self, problem: Problem, scalarisation: Scalarisation, x0: Array, *more: Any, **named: Any
        ) -> Solution:
            begun.append(float(x0[0]))
            return super().solve(problem, scalarisation, x0, *more, **named)

    start = Multistart(Watched(), seed=1)
    guess = float(start.points(problem)[0][0])
    found = start.solve(problem, TIME)
    stone = Exchange().solve(plain, WeightedSum({"effort": 1.0}), np.array([guess]))
    assert begun == [guess, pytest.approx(float(stone.x[0]), rel=1e-9)]
    assert found.x[0] == pytest.approx(Quintic().least_time, rel=1e-7)
    assert found.iterations >= stone.iterations
    start.solve(problem, TIME)  # the stone is known
    assert len(begun) == 3
    start.solve(problem, WeightedSum({"effort": 1.0}))  # and is no stone of its own
    assert begun[3] == guess


def test_the_same_seed_gives_the_same_solutions_bit_by_bit() -> None:
    one, two = (Multistart(starts=4, seed=5).solve_all(quintic_problem(), TIME) for _ in range(2))
    assert [s.x.tolist() for s in one] == [s.x.tolist() for s in two]
    assert [s.iterations for s in one] == [s.iterations for s in two]


def test_a_start_is_solved_the_same_whatever_comes_after_it() -> None:
    few, many = (Multistart(starts=n, seed=5).solve_all(quintic_problem(), TIME) for n in (2, 4))
    assert [s.x.tolist() for s in few] == [s.x.tolist() for s in many[:2]]


def test_the_best_of_all_starts_is_returned_with_the_time_of_all() -> None:
    problem = quintic_problem()
    best = Multistart(starts=4, seed=0).solve(problem, TIME)
    every = Multistart(starts=4, seed=0).solve_all(problem, TIME)
    assert best.f == min(s.f for s in every)
    assert best.audit is not None and best.audit.proved
    assert best.x[0] == pytest.approx(Quintic().least_time, rel=1e-8)
    assert best.seconds > max(s.seconds for s in every) / 2


def test_a_start_that_begins_worse_than_the_best_ends_is_given_up_and_counted() -> None:
    worse = count()

    class Worse(Ipopt):
        """Cold solves end in ever worse points."""

        def solve(self, nlp: NLP, x0: Array, warm: NLPResult | None = None) -> NLPResult:
            result = super().solve(nlp, x0, warm)
            more = next(worse) if warm is None else 0
            return replace(result, f=result.f + more, x=result.x + more)

    start = Multistart(Exchange(Worse()), starts=4, seed=0)
    found = start.solve(quintic_problem(), TIME)
    assert (found.starts, found.given_up) == (4, 3)
    assert found.x[0] == pytest.approx(Quintic().least_time, rel=1e-8)
    assert "4 starts (3 given up)" in repr(found)
    assert len(start.solve_all(quintic_problem(), TIME)) == 4


class Watched(Exchange):
    """Tells which starts are followed beyond their first NLP."""

    followed: ClassVar[list[float]] = []

    def solve(self, problem: Problem, scalarisation: Scalarisation, x0: Array, *more: Any, **named: Any) -> Solution:
        self.followed.append(float(x0[0]))
        return super().solve(problem, scalarisation, x0, *more, **named)


def two_valleys() -> Problem:
    """The quintic with an objective of two valleys, of which the one near 5 s is the deeper."""
    problem = quintic_problem()
    valleys = Objective(
        "valleys", "-", of_variables=lambda x, p: (x[0] - 3.0) ** 2 * (x[0] - 5.0) ** 2 - 0.1 * x[0] + 1.0
    )
    return replace(problem, objectives=(*problem.objectives, valleys), guess=lambda rng: rng.uniform([2.0], [6.0]))


def test_of_some_starts_the_one_that_begins_best_is_followed_first_and_others_are_given_up() -> None:
    problem, scalar = two_valleys(), WeightedSum({"valleys": 1.0})
    start = Multistart(Watched(), starts=3, seed=11)
    points = [float(x[0]) for x in start.points(problem)]
    assert points[0] < 4.0 < max(points)  # the first leads to the shallower valley
    Watched.followed.clear()
    found = start.solve(problem, scalar)
    assert len(Watched.followed) == 1 and Watched.followed[0] > 4.0
    assert found.f == min(solution.f for solution in start.solve_all(problem, scalar))
    assert found.given_up == sum(x < 4.0 for x in points)


def test_a_start_whose_first_nlp_has_no_solution_is_given_up_beside_one_that_is_proved() -> None:
    class Fails(Ipopt):
        """From what is left of 4 s."""

        def limited(self, iterations: int) -> "Fails":
            return self

        def solve(self, nlp: NLP, x0: Array, warm: NLPResult | None = None) -> NLPResult:
            result = super().solve(nlp, x0, warm)
            return replace(result, status=Status.ITERATION_LIMIT) if x0[0] < 4.0 else result

    found = Multistart(Exchange(Fails()), starts=3, seed=11).solve(two_valleys(), WeightedSum({"valleys": 1.0}))
    assert found.audit is not None and found.audit.proved and found.x[0] > 4.0
    assert found.given_up >= 1


def test_a_solution_that_is_known_is_the_best_where_no_start_is_better_by_enough() -> None:
    problem, scalar = two_valleys(), WeightedSum({"valleys": 1.0})
    start = Multistart(starts=3, seed=11)
    shallow = Exchange().solve(problem, scalar, np.array([3.0]))
    deep = start.solve(problem, scalar, beside=shallow)
    assert deep.f < shallow.f and deep.x[0] > 4.0
    same = start.solve(problem, scalar, beside=shallow, gain=2.0 * (shallow.f - deep.f))
    assert (same.f, same.given_up) == (shallow.f, 3)


def test_progress_is_told_after_every_start() -> None:
    told: list[tuple[int, int, str]] = []
    Multistart(starts=3, progress=lambda *words: told.append(words)).solve(quintic_problem(), TIME)
    assert [(done, total) for done, total, _ in told] == [(1, 3), (2, 3), (3, 3)]
    assert all(words.startswith("best 0.53728") for _, _, words in told)  # 1.0746 s over the scale 2


def test_where_every_start_is_infeasible_the_answer_says_why() -> None:
    found = Multistart(starts=2).solve(quintic_problem(), EpsilonConstraint("effort", {"time": 1.0}))
    assert found.status is Status.LOCALLY_INFEASIBLE
    assert found.conflicts and found.starts == 2
    assert "quintic: none of 2 starts found a trajectory; the nearest misses time" in found.explain()


def test_starts_of_all_alternatives_are_counted_and_certainty_is_not_claimed_for_one() -> None:
    """At most 10 s where 18.75 s are needed; the second alternative begins beyond its limit, whatever is done."""
    slow = quintic_problem(Quintic(velocity=0.1))
    at_start = PathConstraint("start-limit", lambda s: s.q + 1.0 - s.u, -np.inf, 0.5, ("rad",), ("j",))
    requirements = replace(slow.requirements, path_constraints=(at_start,))
    impossible = replace(slow, requirements=requirements)
    found = solve(replace(slow, alternatives={"one": slow, "two": slow, "three": impossible}), starts=2)
    assert found.alternatives["three"].status is Status.INFEASIBLE
    assert found.status is Status.LOCALLY_INFEASIBLE
    assert "none of 4 starts found a trajectory; the nearest misses" in found.explain()
    certain = solve(replace(slow, alternatives={"three": impossible}))
    assert "no trajectory meets these limits together: start-limit j" in certain.explain()


def _interrupted(after: int) -> Progress:
    """A progress that is interrupted after so many starts."""

    def told(done: int, total: int, words: str) -> None:
        if done == after:
            raise KeyboardInterrupt

    return told


def test_ctrl_c_keeps_the_solutions_so_far() -> None:
    found = Multistart(starts=9, progress=_interrupted(2)).solve_all(quintic_problem(), TIME)
    assert len(found) == 2 and all(s.ok for s in found)


def test_ctrl_c_before_the_first_solution_ends_it() -> None:
    with pytest.raises(KeyboardInterrupt):
        Multistart(Exchange(progress=_interrupted(1)), starts=9).solve_all(quintic_problem(), TIME)


# --- the best ---


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        (solution(2.0), solution(3.0)),
        (solution(3.0), solution(2.0, verdict=UNDECIDED)),
        (solution(3.0), solution(2.0, verdict=None)),
        (solution(3.0, Status.FEASIBLE), solution(2.0, verdict=UNDECIDED)),
        (solution(3.0, verdict=UNDECIDED), solution(2.0, Status.FAILED, None)),
        (solution(3.0, Status.UNPROVED, UNDECIDED), solution(2.0, Status.LOCALLY_INFEASIBLE, None)),
        (solution(3.0, Status.LOCALLY_INFEASIBLE, None), solution(2.0, Status.FAILED, None)),
        (missing(3.0, 0.1), missing(2.0, 0.2)),
        (solution(3.0, Status.FAILED, None), solution(2.0, Status.INFEASIBLE, None)),
        (solution(3.0, Status.LOCALLY_INFEASIBLE, None), solution(-np.inf, Status.UNBOUNDED, None)),
    ],
)
def test_proved_beats_usable_beats_the_nearest_miss_beats_failed_then_the_value_counts(
    better: Solution, worse: Solution
) -> None:
    assert best_of([better, worse]) is better
    assert best_of([worse, better]) is better


def test_a_solution_without_a_value_never_wins() -> None:
    sound = solution(5.0)
    assert best_of([replace(sound, f=np.inf), sound]) is sound
