"""What limits cost: against an identity of scaling in time, and against solving again with a limit made wider."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ocp_traj as ot
from ocp_traj.cli.commands import run
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.limit_gains import WHOLE, limit_gains
from ocp_traj.robot.joint_limits import QUANTITIES
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt

EXAMPLES = Path(__file__).parent.parent / "examples" / "tasks"
ORDER = {f"{name}-limit": order for order, name in enumerate(QUANTITIES[: len(ORDERS)])}


def _per_limit(solution: ot.Solution) -> dict[str, float]:
    """Gains of whole limits [s per 1 %], rows of limits with one active joint counted as the whole."""
    whole = {g.limit: g.gain for g in solution.gains if g.label == WHOLE}
    return {g.limit: g.gain for g in solution.gains} | whole


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "changes"),
    [
        ("ur5-via", {}),
        # Limits that rest at knots too, where they are bounds of variables as well as rows.
        ("ur5-via", {"curve.kind": "quintic", "curve.pieces": 2, "limits.velocity": "20 %"}),
        ("ur5-retime", {"curve.pieces": 2, "limits.velocity": "20 %"}),
    ],
)
def test_limits_on_derivatives_share_the_time_among_them(file: str, changes: dict[str, object]) -> None:
    """T(V/s, A/s^2, J/s^3) = s T(V, A, J), so that the sum of order x gain of the limits is T, by Euler."""
    changes = {"limits.effort": "none", "limits.position": "none", **changes}
    problem = ot.problems.load("task", file=str(EXAMPLES / f"{file}.toml"), **changes)
    solution = ot.solve(problem)
    gains = _per_limit(solution)
    assert {"jerk-limit"} <= set(gains) <= set(ORDER)
    assert ("velocity-limit" in gains) == bool(changes.get("limits.velocity"))
    shares = sum(ORDER[limit] * gain * 100.0 for limit, gain in gains.items())
    assert shares == pytest.approx(solution.f, rel=2e-6)  # of the back-off of 1e-9 and tolerances of 1e-8


@pytest.mark.slow
def test_a_bound_of_zero_has_a_slope_and_no_per_cent() -> None:
    """Obstacles do not change with time, so that the identity is of the limits on derivatives alone."""
    problem, solver = ot.problems.load("wrist-obstacle"), Exchange(Ipopt(tol=1e-10))
    solution = ot.solve(problem, objective="time", starts=2, certify=False, solver=solver)
    (obstacle,) = (g for g in solution.gains if g.limit == "obstacles")
    assert obstacle.gain == 0.0 and obstacle.slope > 0.0
    shares = sum(ORDER.get(limit, 0) * gain * 100.0 for limit, gain in _per_limit(solution).items())
    assert shares == pytest.approx(solution.f, rel=2e-6)


def _wider(problem: Problem, limit: str, row: int, factor: float) -> Problem:
    """The problem with one row of a limit so many times as wide."""

    def widened(bound: np.ndarray) -> np.ndarray:
        return np.where(np.arange(len(bound)) == row, factor * bound, bound)

    changed = [
        c if c.id != limit else replace(c, lower=widened(c.lower), upper=widened(c.upper))
        for c in problem.requirements.path_constraints
    ]
    return replace(problem, requirements=replace(problem.requirements, path_constraints=tuple(changed)))


@pytest.mark.slow
def test_gains_are_the_differences_of_solving_again() -> None:
    problem = ot.problems.load("hybrid-spline")
    found = ot.solve(problem, objective="time", starts=1, certify=False)
    assert [(g.limit, g.label) for g in found.gains[:2]] == [("effort-limit", "F3"), ("velocity-limit", "X_S2")]
    limits = {c.id: c for c in problem.requirements.path_constraints}
    for gain in found.gains[:2]:
        row = limits[gain.limit].labels.index(gain.label)
        bound = abs(float(limits[gain.limit].upper[row]))
        assert gain.gain == pytest.approx(0.01 * gain.slope * bound, rel=1e-12)
        less, more, wide = (
            ot.solve(_wider(problem, gain.limit, row, factor), objective="time", starts=1, certify=False)
            for factor in (0.9999, 1.0001, 1.01)
        )
        # What is left is of third order, 1e-8 of the gain, and the solver's 1e-9 of the time over the difference.
        assert (less.f - more.f) / 0.02 == pytest.approx(gain.gain, rel=2e-6 * found.f / gain.gain * 0.02 + 1e-5)
        # 1 % wider: the mean of a slope that falls all the way.
        last = next(g for g in wide.gains if (g.limit, g.label) == (gain.limit, gain.label))
        assert last.slope < (found.f - wide.f) / (0.01 * bound) < gain.slope


@pytest.mark.slow
def test_what_is_no_optimum_has_no_gains() -> None:
    problem = ot.problems.load("rotor-353")
    population = ot.solve(problem, objective="time", method="pso", certify=False, population=20, generations=3)
    assert population.gains == ()
    stopped = replace(ot.solve(problem, objective="time", starts=1, certify=False), multipliers={})
    assert limit_gains(problem, WeightedSum({"time": 1.0}), stopped) == ()


@pytest.mark.slow
def test_gains_are_in_the_table_and_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", str(EXAMPLES / "ur5-via.toml"), "--json"]) == 0
    gains = json.loads(capsys.readouterr().out)["gains"]
    assert gains[0]["limit"] == "acceleration-limit" and gains[0]["label"] == WHOLE and gains[0]["unit"] == "s"
    assert [g["gain"] for g in gains] == sorted((g["gain"] for g in gains), reverse=True)
    assert run(["solve", str(EXAMPLES / "ur5-via.toml")]) == 0
    assert "What limits cost" in capsys.readouterr().out
