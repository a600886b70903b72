"""What ``benchmarks/speed.py`` measures, one row a process.

``python speed_rows.py ROW CORE [NAME=VALUE ..]`` prints a line of JSON. A row runs with the package of whatever
environment it is run in: this one, or the one before. Nothing but the call between the two readings of the clock is
timed; imports and, but in ``cost``, the building of the problem are not.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import files
from importlib.util import find_spec
from typing import Any

import casadi
import moocore
import numpy as np
from numpy.typing import NDArray

import ocp_traj as ot
from ocp_traj.errors import NoSolutionFound
from ocp_traj.solvers.mopso import MOPSO
from ocp_traj.solvers.nsga2 import NSGA2

Array = NDArray[np.float64]  # the commit before has it nowhere

if find_spec("ocp_traj.formulation") is None:  # before the packages had packages of their own
    from ocp_traj.audit import audit_all
    from ocp_traj.limits import Limits as JointLimits
    from ocp_traj.objective import TRAPEZOID
    from ocp_traj.population import Population
    from ocp_traj.solvers import evolution
    from ocp_traj.solvers.pareto_set import ParetoSet, proved_front

    TEXTS: dict[str, Any] = {"title": "UR5", "reference": ""}  # asked for by ``Problem`` then
else:
    from ocp_traj.evolution import evolution
    from ocp_traj.evolution.population import Population
    from ocp_traj.formulation.objective import TRAPEZOID
    from ocp_traj.proof.audit import audit_all
    from ocp_traj.results.pareto_set import ParetoSet, proved_front
    from ocp_traj.robot.joint_limits import JointLimits

    TEXTS = {}

Figures = dict[str, Any]

TRADED = ("time", "energy")
IDEAL, REFERENCE = np.array([2.4836, 1565.2]), np.array([8.0, 6000.0])  # [s], [N2 m2/s]: the box of the hypervolume
BUDGETS = (3.0, 10.0, 30.0)  # [s]
EVERY = 0.2  # [s] between looks at a population
UNBOUNDED = 1_000_000  # points, generations
INDIVIDUALS, GENERATIONS = 100, 50


def timed(call: Callable[[], Any]) -> tuple[Any, Figures]:
    """What a call returns, its seconds and those of its process."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = call()
    return found, {"seconds": time.perf_counter() - wall, "cpu": time.process_time() - cpu}


def hypervolume(values: Array) -> float:
    """Share of the box that values ``(N, 2)`` of the traded objectives dominate."""
    scaled = np.maximum((values - IDEAL) / (REFERENCE - IDEAL), 0.0)
    return float(moocore.hypervolume(scaled, ref=np.ones(2))) if len(values) else 0.0


def of_front(front: Any) -> Figures:
    """How many points are proved, and their hypervolume."""
    return {"proved": len(front), "hypervolume": hypervolume(front.values)}


# --- rows ---


def front() -> Figures:
    """Forty points, proved."""
    found, figures = timed(partial(ot.pareto, ot.problems.load("hybrid-spline"), TRADED, points=40))
    return figures | of_front(found)


def nsga2() -> Figures:
    """NSGA-II, 100 x 200, without audit; proved, where slowing down helps, after the clock has stopped."""
    problem = ot.problems.load("hybrid-spline")
    found, figures = timed(partial(NSGA2(seed=0).pareto, problem, TRADED))
    return figures | _as_found_and_proved(problem, found.xs)


def _as_found_and_proved(problem: Any, xs: Sequence[Any]) -> Figures:
    vectors = [np.asarray(x, dtype=float) for x in xs]
    found = Population(problem, TRADED).evaluate(vectors).objectives if vectors else np.empty((0, 2))
    return {"as found": hypervolume(found)} | of_front(proved_front(problem, TRADED, ParetoSet(vectors, "", 0, 0.0)))


def trace(budget: float, seed: float) -> Figures:
    """The tracer, as many points as it has time for."""
    problem = ot.problems.load("hybrid-spline")

    def call() -> Any:
        try:
            return ot.pareto(problem, TRADED, points=UNBOUNDED, budget=budget, seed=int(seed))
        except NoSolutionFound:
            return None

    found, figures = timed(call)
    return figures | ({"proved": 0, "hypervolume": 0.0} if found is None else of_front(found))


def population(method: str, size: float, seed: float) -> Figures:
    """One run of NSGA-II or MOPSO, seen when each of the budgets has passed: the first look after it."""
    problem = ot.problems.load("hybrid-spline")
    evolution.EVERY, evolution.SHARE = EVERY, 0.0  # how often a run tells what it has
    seen: dict[float, list[Any]] = {}
    chosen: Any = {"nsga2": NSGA2, "mopso": MOPSO}[method]

    def look(record: Any) -> None:
        passed = time.perf_counter() - begun
        seen.update({b: [p["x"] for p in record["points"]] for b in BUDGETS if passed >= b and b not in seen})

    begun = time.perf_counter()
    solver = chosen(
        seed=int(seed), population=int(size), generations=UNBOUNDED, max_seconds=BUDGETS[-1] + EVERY, found=look
    )
    found, figures = timed(partial(solver.pareto, problem, TRADED))
    figures["generations"] = found.info["evaluation calls"]
    return figures | {f"{b:g} s": _as_found_and_proved(problem, seen.get(b, [])) for b in BUDGETS}


def _solved(problem: Any, **options: Any) -> Figures:
    found, figures = timed(partial(ot.solve, problem, **options))
    proved = found.audit is not None and found.audit.proved
    return figures | {"objective": found.f, "proved": int(proved), "iterations": found.iterations}


def cost() -> Figures:
    """One start, the building of the problem included."""
    found, figures = timed(lambda: ot.solve(ot.problems.load("hybrid-spline"), objective="cost", starts=1))
    return figures | {"objective": found.f, "proved": int(found.audit.proved), "iterations": found.iterations}


def wrist() -> Figures:
    """Twenty starts of each of the two ways to hold the goal."""
    return _solved(ot.problems.load("wrist-obstacle"), starts=20)


def weld() -> Figures:
    """The default objective."""
    return _solved(ot.problems.load("weld-bezier"))


def weld_air_time() -> Figures:
    """Least time in the air."""
    return _solved(ot.problems.load("weld-bezier"), objective="air_time")


def rotor() -> Figures:
    """Least time, certified by branch and bound."""
    found, figures = timed(partial(ot.solve, ot.problems.load("rotor-353"), certify=True))
    certified = found.certificate is not None and found.certificate.certified
    return figures | {"objective": found.f, "proved": int(found.audit.proved and certified)}


def ur5_solve() -> Figures:
    """Least time through twenty points."""
    return _solved(ur5())


def ur5_front() -> Figures:
    """Fifteen points of time against effort."""
    found, figures = timed(partial(ot.pareto, ur5(), ("time", "effort"), points=15))
    return figures | {"proved": len(found), "hypervolume": found.hypervolume().value}


def audit() -> Figures:
    """A nonic arm of six joints from rest to rest: median of seven proofs, one before them; a scan beside it."""
    from benchmarks.audit import milliseconds, scan, subjects

    arm = next(subject for subject in subjects() if subject.name == "arm, rest to rest")
    call, figures = partial(audit_all, arm.trajectories, arm.requirements), {}
    cpu, wall = time.process_time(), time.perf_counter()
    figures["seconds"] = 1e-3 * milliseconds(call)
    figures["cpu"] = figures["seconds"] * (time.process_time() - cpu) / (time.perf_counter() - wall)
    looking = 1e-3 * milliseconds(partial(scan, arm.trajectories[0], arm.requirements), 3)
    return figures | {"scan": looking, "proved": int(all(one.proved for one in call()))}


def individual() -> Figures:
    """An individual of hybrid-spline, 49 instants and six limits: a hundred together, the mean of fifty passes."""
    problem = ot.problems.load("hybrid-spline")
    rng = np.random.default_rng(0)
    x = np.array([problem.guess(rng) for _ in range(INDIVIDUALS)])
    tapes = Population(problem, TRADED)
    tapes.evaluate(x)
    _, figures = timed(lambda: [tapes.evaluate(x) for _ in range(GENERATIONS)])
    return {name: value / (INDIVIDUALS * GENERATIONS) for name, value in figures.items()}


# --- a UR5 through points of a walk, with limits up to jerk and on torques ---

WALK, SHARE_OF_RANGE, FARTHEST = 0.45, 0.6, 1.2  # of a step [rad], of the joints' ranges, from the middle [rad]
MIDDLE = np.array([0.0, -1.3, 1.4, -1.6, -1.5, 0.0])  # [rad]
ACCELERATION, JERK, PAYLOAD = 8.0, 60.0, 3.0  # [rad/s2], [rad/s3], [kg]: our choice
SHORTEST, LONGEST = 0.02, 10.0  # [s] of an interval


def walk(robot: Any, count: int = 20, seed: int = 1) -> Array:
    """Points ``(count, 6)`` [rad] of a random walk about the middle, within the joints' ranges."""
    lower, upper = (np.clip(bound, -3.0, 3.0) for bound in robot.limits.bounds("position"))
    steps = np.cumsum(WALK * np.random.default_rng(seed).normal(size=(count, robot.size)), axis=0)
    steps -= steps.mean(axis=0)
    room = np.minimum(SHARE_OF_RANGE * np.minimum(upper - MIDDLE, MIDDLE - lower), FARTHEST)
    return np.asarray(MIDDLE + steps / max(1.0, float((np.abs(steps) / room).max())))


def ur5() -> ot.Problem:
    """The problem: durations of a cubic spline with two free knots at its ends."""
    (urdf,) = (file.locate() for file in files("example-robot-data") or () if file.name == "ur5_robot.urdf")
    limits = JointLimits(acceleration=[ACCELERATION] * 6, jerk=[JERK] * 6)
    robot = ot.Robot.from_urdf(str(urdf), limits=limits, tool_frame="tool0")
    points, axes = walk(robot), (robot.joints, robot.units)
    count, most = len(points) + 1, robot.limits.bounds("effort")
    least = (np.abs(np.diff(points, axis=0)) / robot.limits.bounds("velocity")[1]).max(axis=1)
    at = ((0, 0.0), *((k, 0.0) for k in range(2, count - 1)), (-1, 1.0))

    def torque(s: ot.State) -> Any:
        return robot.effort(s.q, s.v, s.a, payload=PAYLOAD)

    def guess(rng: np.random.Generator) -> Array:
        whole = np.maximum(least, 0.1) * rng.uniform(1.5, 4.0, len(least))
        ends = [0.5 * whole[0]] * 2, [0.5 * whole[-1]] * 2
        return np.clip(np.concatenate([ends[0], whole[1:-1], ends[1]]), SHORTEST, LONGEST)

    effort = ot.standard.effort_limit(torque, most, robot.effort_units, robot.joints)
    return ot.Problem(
        id="ur5", case=None, robot=robot,
        variables=(
            ot.Variable("h", np.full(count, SHORTEST), np.full(count, LONGEST), "s",
                        tuple(f"h{i + 1}" for i in range(count))),
        ),
        curve=lambda h: ot.curves.cubic_spline_free_ends(points, h),
        objectives=(
            ot.Objective("time", "s", of_variables=lambda h, p: casadi.sum1(h)),
            ot.Objective("effort", "s", integrand=lambda s: casadi.sumsqr(torque(s) / casadi.DM(most[1])),
                         quadrature=TRAPEZOID),
        ),
        default_objective="time", reference_point={"time": 20.0, "effort": 5.0},
        requirements=ot.Requirements(
            *axes, (*ot.standard.joint_limits(robot.limits, *axes), effort),
            (ot.standard.rest(*axes), ot.standard.via_points(points, at, *axes)), continuity=2,
        ),
        guess=guess, dilate=lambda h, s: np.asarray(h) * s, **TEXTS,
    )  # fmt: skip


ROWS: dict[str, Callable[..., Figures]] = {
    row.__name__: row
    for row in (
        front, nsga2, trace, population, cost, wrist, weld, weld_air_time, rotor, ur5_solve, ur5_front, audit,
        individual,
    )
}  # fmt: skip


def main(name: str, core: str, *given: str) -> None:
    """Runs one row on one core."""
    os.sched_setaffinity(0, {int(core)})
    _ = ot.pareto, ot.solve, ot.standard, ot.problems, ot.curves  # imported on first use
    options: dict[str, Any] = dict(one.split("=") for one in given)
    options = {key: value if key == "method" else float(value) for key, value in options.items()}
    print(json.dumps(ROWS[name](**options) | {"package": ot.__file__}))


if __name__ == "__main__":
    main(*sys.argv[1:])
