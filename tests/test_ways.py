"""Starts past obstacles: trees that connect, polylines rounded, clearances scanned, paths of files."""

from pathlib import Path

import numpy as np
import pytest

from ocp_traj.arrays import Array
from ocp_traj.curves.rounded import rounded
from ocp_traj.errors import InputError
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.ways import Ways
from ocp_traj.paths.connecting_trees import STEP, Space, connect, shortened
from ocp_traj.problems import load
from ocp_traj.robot.bodies import Body, box, capsule, cylinder, half_space, sphere
from ocp_traj.robot.clearance_scan import SAG, ClearanceScan
from ocp_traj.robot.pair_distances import PairDistances
from ocp_traj.robot.robot import Robot
from ocp_traj.solvers.way_back import WayBack
from ocp_traj.transcription.symbolic import motion_of

LOW, HIGH = np.full(2, -1.0), np.full(2, 1.0)


def beside_the_wall(q: Array) -> Array:
    """A wall at x = 0 that leaves a gap above y = 0.6."""
    return (np.abs(q[:, 0]) > 0.1) | (q[:, 1] > 0.6)


@pytest.mark.parametrize("seed", range(5))
def test_a_path_is_clear_wherever_it_was_looked_at_and_gets_no_longer(seed: int) -> None:
    space = Space(LOW, HIGH, np.ones(2), beside_the_wall)
    start, goal = np.array([-0.8, -0.8]), np.array([0.8, -0.8])
    path = connect(space, start, goal, np.random.default_rng(seed), 20_000)
    assert path is not None and (path[0] == start).all() and (path[-1] == goal).all()
    short = shortened(space, path, np.random.default_rng(seed))
    lengths = [np.linalg.norm(np.diff(p, axis=0), axis=1).sum() for p in (path, short)]
    assert lengths[1] <= lengths[0] + 1e-12
    # No shorter than the shortest through the gap's two corners, but for what a step may cut off them.
    shortest = 2.0 * np.hypot(0.7, 1.4) + 0.2
    assert lengths[1] >= shortest - 4.0 * STEP
    assert lengths[1] <= 1.2 * shortest
    for one in (path, short):
        for a, b in zip(one, one[1:], strict=False):
            dense = a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)
            blocked = np.mean(~beside_the_wall(dense)) * np.linalg.norm(b - a)
            assert blocked < STEP  # between two looks a corner may be cut


def test_the_same_seed_gives_the_same_path_and_no_way_gives_none() -> None:
    space = Space(LOW, HIGH, np.ones(2), beside_the_wall)
    ends = np.array([-0.8, -0.8]), np.array([0.8, -0.8])
    first, again = (connect(space, *ends, np.random.default_rng(3), 20_000) for _ in range(2))
    assert first is not None and again is not None and (first == again).all()
    closed = Space(LOW, HIGH, np.ones(2), lambda q: np.abs(q[:, 0]) > 0.1)
    assert connect(closed, *ends, np.random.default_rng(3), 3000) is None
    assert connect(space, ends[0], np.array([-0.8, 0.9]), np.random.default_rng(0), 100).shape == (2, 2)  # type: ignore[union-attr]


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_a_rounded_polyline_keeps_its_ends_its_limits_and_comes_near_its_corners(slower: float) -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.5, 1.5, size=(5, 3))
    speed, acceleration, jerk = np.full(3, 2.0), np.full(3, 8.0), np.full(3, 60.0)
    motion = rounded(points, speed, acceleration, jerk, slower)
    q, v, a = (motion.states[:, k] for k in range(3))
    assert (q[0] == points[0]).all() and (q[-1] == points[-1]).all()
    assert np.abs(v[[0, -1]]).max() < 0.05 * 2.0
    grid = 2e-2  # what a grid of finite differences leaves
    assert np.abs(v).max() <= 2.0 / slower * (1.0 + grid)
    assert np.abs(a).max() <= 8.0 * (1.0 + grid)
    # It stays within the polyline's box, and derivatives are those of the positions.
    assert (q >= points.min(axis=0) - 1e-9).all() and (q <= points.max(axis=0) + 1e-9).all()
    assert np.abs(np.gradient(q, motion.times, axis=0) - v).max() < 1e-9 * np.abs(v).max() + 1e-9
    assert motion.passed[0] == 0.0 and motion.passed[-1] == motion.duration and (np.diff(motion.passed) > 0.0).all()
    misses = np.linalg.norm(motion.at(motion.passed)[:, 0] - points, axis=1)
    assert misses.max() < (0.35 if slower == 1.0 else 0.06)  # the cut shrinks with the square of the speed


def arm() -> Robot:
    return Robot.from_description("ur5", file_limits=False)


def bodies(robot: Robot) -> tuple[list[Body], list[Body]]:
    own = [
        capsule("upper", 2, [0.0, 0.13, 0.0], [0.0, 0.13, 0.42], 0.06),
        capsule("fore", 3, [0.0, 0.0, 0.0], [0.0, 0.0, 0.39], 0.05),
        sphere("hand", 6, [0.0, 0.1, 0.0], 0.05),
    ]
    around = [
        sphere("ball", 0, [0.5, 0.2, 0.4], 0.1),
        box(
            "crate",
            0,
            [-0.4, 0.3, 0.2],
            [0.3, 0.2, 0.5],
            np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0] * 1.0,
        ),
        cylinder("post", 0, [0.3, -0.5, 0.0], [0.4, -0.5, 0.8], 0.05),
        half_space("floor", [0.0, 0.0, 1.0], -0.2),
    ]
    return own, around


def test_a_scan_finds_what_exact_distances_are_up_to_its_balls() -> None:
    robot = arm()
    own, around = bodies(robot)
    pairs = [(a, b) for a in own for b in around] + [(own[0], own[2])]
    scan = ClearanceScan(robot, pairs, [0.01] * len(pairs))
    q = np.random.default_rng(0).uniform(-3.0, 3.0, size=(300, 6))
    exact = PairDistances(robot, pairs).least(q) - 0.01
    found = scan.least(q)
    outside = exact > 0.0
    assert outside.any() and not outside.all()
    # Balls along a capsule hold it but for SAG of its radius: a scan finds no less, and hardly more.
    assert (found >= exact - 1e-9)[outside].all()
    assert (found - exact)[outside].max() <= SAG * 0.06 * 2.0 + 1e-9
    assert ((found >= 0.0) == scan.clear(q)).all()


def test_bounds_of_distances_hold_and_walls_are_told_from_large_balls() -> None:
    robot = arm()
    own, around = bodies(robot)
    pairs = [(a, b) for a in own for b in around] + [(own[0], own[2])]
    distances = PairDistances(robot, pairs)
    q = np.random.default_rng(1).uniform(-3.0, 3.0, size=(200, 6))
    rows = np.tile(np.arange(len(pairs)), len(q))
    exact = distances.distances(np.repeat(q, len(pairs), axis=0), rows).reshape(len(q), -1)
    bound = distances.at_least(q)
    assert (bound <= exact + 1e-9).all()
    assert np.abs(distances.least(q) - exact.min(axis=1)).max() == 0.0
    # A ball against a box, a ball and a half-space: the bound is the distance.
    hand = [i for i, (a, b) in enumerate(pairs) if "hand" in (a.name, b.name) and "post" not in (a.name, b.name)][:3]
    assert np.abs(bound - exact)[:, hand][exact[:, hand] > 0.0].max() < 1e-9


def held(robot: Robot) -> tuple[ClearanceConstraint, ...]:
    own, around = bodies(robot)
    pairs = tuple((i, len(own) + j) for i in range(len(own)) for j in range(len(around)))
    return (ClearanceConstraint("obstacles", robot, (*own, *around), pairs, 0.005),)


def test_a_given_path_is_cut_at_the_via_points_and_refused_where_it_misses_one() -> None:
    robot = arm()
    points = np.random.default_rng(0).uniform(-1.0, 1.0, size=(3, 6))
    path = np.array([points[0] + 1e-4, [0.3] * 6, points[1], [0.1] * 6, [0.2] * 6, points[2]])
    ways = Ways(points, robot, (), given=path)
    motion = ways(0, 2, np.random.default_rng(0))
    assert motion is not None and len(motion.passed) == 3
    assert (motion.states[0, 0] == points[0]).all() and (motion.states[-1, 0] == points[2]).all()
    for missed, words in ((1, "comes as near as"), (0, "begins"), (2, "ends")):
        off = path.copy()
        off[[0, 2, 5][missed]] += 0.2
        with pytest.raises(InputError, match=rf"\[solve\] start {words} .* from point {missed + 1} of"):
            Ways(points[[0, 1, 2]], robot, (), given=off, name="t")


TASK = """
format = "ocp-traj/task/1"
robot = { description = "ur5", tool_frame = "tool0" }
limits = { acceleration = 8.0, jerk = 60.0 }
curve = { kind = "quintic", pieces = 8 }
[[move]]
via = [[-0.9, -1.2, 1.5, -1.8, -1.5, 0.0], [0.9, -1.0, 1.3, -1.8, -1.5, 0.0]]
[collision]
links = "given"
link = [{ frame = "wrist_3_link", from = [0, 0, 0], to = [0, 0, 0.1], radius = 0.05 },
        { frame = "forearm_link", from = [0, 0, 0], to = [0, 0, 0.39], radius = 0.05 }]
self = false
clearance = 0.01
[[collision.obstacle]]
name = "wall"
box = { centre = [0.55, 0.0, 0.2], size = [0.6, 0.05, 0.7] }
"""


def start_of(tmp_path: Path, start: str) -> tuple[Array, Array]:
    """Clearances, less what is asked for, along a task's start, and its postures."""
    (tmp_path / "task.toml").write_text(f"{TASK}[solve]\nstart = {start}\n")
    problem = load("task", file=str(tmp_path / "task.toml"))
    x = problem.guess(np.random.default_rng([0, 0]))
    assert (x >= problem.lower).all() and (x <= problem.upper).all()
    (limit,) = problem.requirements.clearance_constraints
    curve = problem.curve(x)
    q = curve(np.linspace(0.0, float(curve.duration), 300))
    pairs = [(limit.bodies[i], limit.bodies[j]) for i, j in limit.pairs]
    return PairDistances(limit.robot, pairs).least(q) - limit.clearance, q


@pytest.mark.slow
def test_starts_of_a_task_straight_planned_and_from_a_file(tmp_path: Path) -> None:
    straight, _ = start_of(tmp_path, '"straight"')
    assert straight.min() < -0.05  # through the wall
    planned, _ = start_of(tmp_path, '"plan"')
    assert planned.min() > -0.01  # rounded corners may be a little near
    names = "shoulder_pan_joint,shoulder_lift_joint,elbow_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint"
    middle = [0.1, -1.9, 1.2, -0.5, -1.4, 0.3]
    points = [[-0.9, -1.2, 1.5, -1.8, -1.5, 0.0], middle, [0.9, -1.0, 1.3, -1.8, -1.5, 0.0]]
    (tmp_path / "path.csv").write_text("\n".join([names, *(",".join(map(str, p)) for p in points)]))
    _, q = start_of(tmp_path, '"path.csv"')
    assert np.linalg.norm(q - middle, axis=1).min() < 0.5 < np.linalg.norm(q[[0, -1]] - middle, axis=1).min()


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ('"plann"', "start is 'plann' (nearest is 'plan'); give auto, straight, plan, ompl, or the path"),
        ('"no.csv"', "no.csv: No such file"),
        ("3", "[solve] start is 3; give"),
        ('""', "[solve] start is ''; give"),
    ],
)
def test_a_wrong_start_is_one_line(tmp_path: Path, start: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        start_of(tmp_path, start)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.slow
def test_a_start_that_a_curve_does_not_take_is_refused(tmp_path: Path) -> None:
    text = TASK.replace('{ kind = "quintic", pieces = 8 }', '{ kind = "cubic" }')
    text = text.replace("0.0], [0.9", "0.0], [0.0, -1.8, 1.2, -1.0, -1.5, 0.0], [0.9")
    (tmp_path / "task.toml").write_text(f'{text}[solve]\nstart = "plan"\n')
    with pytest.raises(InputError, match="start is not of a cubic curve"):
        load("task", file=str(tmp_path / "task.toml"))
    text = TASK[: TASK.index("[collision]")]
    (tmp_path / "task.toml").write_text(f'{text}[solve]\nstart = "plan"\n')
    with pytest.raises(InputError, match="plans past obstacles, and there is no"):
        load("task", file=str(tmp_path / "task.toml"))


@pytest.mark.slow
def test_a_stalled_solve_that_went_through_the_wall_begins_at_the_clear_start_again(tmp_path: Path) -> None:
    (tmp_path / "task.toml").write_text(TASK)
    problem, straight = (
        load("task", file=str(tmp_path / "task.toml"), **{"solve.start": start}) for start in ("plan", "straight")
    )
    assert problem.variables_of is not None
    points = {"plan": problem.guess(np.random.default_rng([0, 0]))}
    points["straight"] = problem.variables_of(motion_of(straight, straight.guess(np.random.default_rng([0, 0]))))
    back = WayBack(problem, points["plan"])
    assert back.after(points["straight"], stalled=False) is None
    assert np.array_equal(back.after(points["straight"], stalled=True), points["plan"])  # type: ignore[arg-type]
    assert back.after(points["plan"], stalled=True) is None
    # From a start in the wall there is none to go back to, until one is known.
    through = WayBack(problem, points["straight"])
    assert through.after(points["straight"], stalled=True) is None
    assert through.after(points["plan"], stalled=True) is None
    assert np.array_equal(through.after(points["straight"], stalled=True), points["plan"])  # type: ignore[arg-type]
