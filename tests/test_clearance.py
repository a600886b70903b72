"""Clearances proved for whole bodies at every instant: known distances, traps, and random motions against a scan."""

from collections.abc import Sequence
from typing import Any

import casadi
import numpy as np
import pinocchio as pin
import pytest

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import ProblemDefinitionError
from ocp_traj.formulation.clearance import ClearanceConstraint
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.proof import clearance, separation
from ocp_traj.proof.audit import audit, audit_all
from ocp_traj.proof.verdicts import PROVED, UNDECIDED, VIOLATED, Audit, AuditRow
from ocp_traj.robot.bodies import Body, box, capsule, cylinder, half_space, sphere
from ocp_traj.robot.chain import AxisJoint
from ocp_traj.robot.robot import ActuatorMap, Robot
from tests import clearance_fuzz
from tests.independent.bodies import Pair, curve_at, least_distance

X, Y, Z = np.eye(3)


def robot(*joints: tuple[str, Any] | tuple[str, Any, Any]) -> Robot:
    """A chain of (kind, axis) or (kind, axis, translation)."""
    prefix = [
        AxisJoint(kind, axis, pin.SE3(np.eye(3), np.asarray(move[0] if move else np.zeros(3), dtype=float)))
        for kind, axis, *move in joints
    ]
    return Robot.from_dh([], [], prefix=prefix)


SLIDE = robot(("prismatic", X))
TURN = robot(("revolute", Z))


def line(*rows: Sequence[float], duration: float = 1.0, of: Robot = SLIDE) -> Motion:
    """A curve with these control points."""
    return Motion(PiecewiseBezier(np.array([duration]), (np.array(rows, dtype=float),)), of.joints)


def proved(of: Robot, motion: Motion, bodies: Sequence[Body], asked: float, **options: Any) -> Audit:
    """The audit of all pairs that move against each other."""
    pairs = tuple(
        (i, j) for i in range(len(bodies)) for j in range(i + 1, len(bodies)) if bodies[i].joint != bodies[j].joint
    )
    limit = ClearanceConstraint("clearance", of, tuple(bodies), pairs, asked)
    return audit(motion, Requirements(of.joints, of.units, (), clearance_constraints=(limit,)), **options)


def row_of(of: Robot, motion: Motion, bodies: Sequence[Body], asked: float, **options: Any) -> AuditRow:
    (row,) = proved(of, motion, bodies, asked, **options).rows
    return row


def tight(of: Robot, motion: Motion, bodies: Sequence[Body], least: float, step: float = 1e-9) -> None:
    """The least distance is what it is said to be: proved below, violated above, enclosed to 0.1 mm."""
    for asked, verdict in ((least - step, PROVED), (least + step, VIOLATED)):
        row = row_of(of, motion, bodies, asked)
        assert row.verdict == verdict, row
        assert row.attained >= least - 1e-12 and row.proved_bound <= least + 1e-12
        assert row.attained - row.proved_bound <= clearance.WIDTH


# --- distances that are known ---


def test_a_ball_that_slides_past_a_ball() -> None:
    bodies = sphere("a", 1, [0.0, 0.3, 0.0], 0.1), sphere("b", 0, [0.2, 0.0, 0.0], 0.05)
    motion = line([-1.0], [-0.5], [0.7], [1.0])
    tight(SLIDE, motion, bodies, 0.15)
    row = row_of(SLIDE, motion, bodies, 0.2)
    q = motion.curve(row.instant)[0, 0]
    assert abs(q - 0.2) < 0.02 and row.label == "a - b" and row.unit == "m" and row.bound == 0.2


@pytest.mark.parametrize("kind", ["capsule", "cylinder"])
def test_a_body_that_turns_about_its_own_axis_keeps_its_distance(kind: str) -> None:
    made = capsule if kind == "capsule" else cylinder
    bodies = made("spindle", 1, -0.3 * Z, 0.3 * Z, 0.1), sphere("b", 0, [0.5, 0.0, 0.1], 0.1)
    tight(TURN, line([-3.0], [9.0], of=TURN), bodies, 0.3)


def test_parallel_segments_that_slide_along_each_other() -> None:
    bodies = capsule("a", 1, -0.2 * X, 0.2 * X, 0.02), capsule("b", 0, [-0.3, 0.1, 0.0], [0.3, 0.1, 0.0], 0.03)
    tight(SLIDE, line([-0.1], [0.1]), bodies, 0.05)
    tight(SLIDE, line([0.8], [0.6]), bodies, float(np.hypot(0.1, 0.1)) - 0.05)


def test_segments_that_become_parallel_where_they_are_nearest() -> None:
    arm = capsule("a", 1, [0.1, 0.2, 0.0], [0.5, 0.2, 0.0], 0.02)
    bodies = arm, capsule("b", 0, [0.1, 0.4, 0.0], [0.5, 0.4, 0.0], 0.02)
    tight(TURN, line([-1.0], [0.0], of=TURN), bodies, 0.16)


def test_a_capsule_without_length_is_a_ball() -> None:
    motion = line([-1.0], [1.0], of=TURN)
    other = box("b", 0, [0.8, 0.1, 0.0], [0.2, 0.2, 0.2])
    rows = [
        row_of(TURN, motion, (made, other), 0.1)
        for made in (sphere("a", 1, [0.5, 0.0, 0.0], 0.1), capsule("a", 1, [0.5, 0.0, 0.0], [0.5, 0.0, 0.0], 0.1))
    ]
    assert rows[0] == rows[1]


def test_contact_at_the_end_of_a_capsule() -> None:
    bodies = capsule("arm", 1, [0.0, 0.0, 0.0], [0.5, 0.0, 0.0], 0.04), sphere("b", 0, [0.8, 0.0, 0.0], 0.1)
    tight(TURN, line([-0.7], [0.7], of=TURN), bodies, 0.16)


def test_corners_edges_and_faces_of_boxes() -> None:
    """The corner of a turning box against the face of another, then edge against edge."""
    bodies = box("a", 1, [0.0, 0.0, 0.0], [0.2, 0.2, 0.2]), box("b", 0, [0.4, 0.0, 0.0], [0.2, 1.0, 1.0])
    tight(TURN, line([0.0], [np.pi / 2], of=TURN), bodies, 0.3 - 0.1 * np.sqrt(2.0))
    edge = np.array([[np.sqrt(0.5), 0.0, np.sqrt(0.5)], [0.0, 1.0, 0.0], [-np.sqrt(0.5), 0.0, np.sqrt(0.5)]])
    other = box("b", 0, [0.5, 0.0, 0.0], [0.2, 1.0, 0.2], edge)
    tight(
        TURN, line([0.0], [np.pi / 2], of=TURN), (bodies[0], other), 0.5 - 0.2 * np.sqrt(2.0) * 0.5 - 0.1 * np.sqrt(2.0)
    )


def test_a_half_space() -> None:
    floor = half_space("floor", [0.0, -3.0, 0.0], -0.9)  # y is kept below 0.3
    bar = box("bar", 1, [0.0, 0.0, 0.0], [0.4, 0.02, 0.1])
    tight(TURN, line([-0.2], [2.0], of=TURN), (bar, floor), 0.3 - float(np.hypot(0.2, 0.01)))
    can = cylinder("can", 1, [-0.1, 0.0, 0.0], [0.1, 0.0, 0.0], 0.05)
    tight(TURN, line([-0.2], [2.0], of=TURN), (can, floor), 0.3 - float(np.hypot(0.1, 0.05)))
    row = row_of(TURN, line([-0.2], [2.0], of=TURN), (bar, half_space("floor", [0.0, -1.0, 0.0], -0.1)), 0.0)
    assert row.verdict == VIOLATED and row.attained == pytest.approx(0.1 - np.hypot(0.2, 0.01), abs=1e-4)


def test_two_links_seen_from_where_they_branch_off() -> None:
    """A pair far up a fast chain moves no faster against each other than the joints between them."""
    fast = robot(("revolute", Z), ("revolute", Z, X), ("revolute", Z, 0.3 * X))
    bodies = sphere("a", 2, [0.0, 0.0, 0.2], 0.05), sphere("b", 3, [0.0, 0.5, 0.2], 0.05)
    still = line([0.0, 0.0, 0.4], [60.0, -60.0, 0.4], of=fast)
    row = row_of(fast, still, bodies, float(np.hypot(0.3 - 0.5 * np.sin(0.4), 0.5 * np.cos(0.4))) - 0.1 - 1e-9)
    assert row.verdict == PROVED and row.boxes == clearance.FIRST


def test_actuators_that_drive_joints_through_a_map() -> None:
    """Coupled, curved coordinates: what is proved is of the joints they move."""
    mapped = Robot.from_dh(
        [], [], prefix=[AxisJoint("revolute", Z), AxisJoint("revolute", Z, pin.SE3(np.eye(3), 0.5 * X))],
        units=("rad", "rad"),
        actuator_map=ActuatorMap("coupled", lambda q: casadi.vertcat(q[0], q[1] - q[0] + 0.2 * casadi.sin(q[1]))),
    )  # fmt: skip
    bodies = capsule("arm", 2, [0.0, 0.0, 0.0], [0.4, 0.0, 0.0], 0.05), sphere("b", 0, [0.5, 0.75, 0.0], 0.1)
    motion = line([-0.5, -0.6], [0.2, 0.4], [0.3, 1.5], of=mapped)
    pair = Pair(mapped.model, *bodies)
    least = min(
        pair.distance(np.array([q[0], q[1] - q[0] + 0.2 * np.sin(q[1])]))
        for q in motion.curve(np.linspace(0.0, 1.0, 4001))
    )
    assert 0.0 < least < 0.2
    tight(mapped, motion, bodies, least, 1e-6)


# --- traps ---


def test_touching_at_exactly_the_clearance_is_never_said_to_be_violated() -> None:
    bodies = sphere("a", 1, [0.0, 0.0, 0.0], 0.25), sphere("b", 0, [2.0, 0.0, 0.0], 0.25)
    for rows in (([0.0], [1.0]), ([0.0], [1.0], [1.0]), ([0.0], [1.0], [1.0], [0.0], [0.5])):
        motion = line(*rows)
        least = 1.5 - float(motion.curve.extrema()[0].upper)
        row = row_of(SLIDE, motion, bodies, least)
        assert row.verdict != VIOLATED and row.boxes < 5000
        assert row.attained == pytest.approx(least, abs=1e-8)


def test_what_passes_between_samples_is_found() -> None:
    """An arm that turns twenty times in a second, and a ball of a millimetre in the plane of its tip."""
    motion = line([0.0], [40.0 * np.pi], of=TURN)
    tip = sphere("tip", 1, [1.0, 0.0, 0.0], 1e-3)
    grazing = sphere("grain", 0, [np.cos(1.0), np.sin(1.0), 2.5e-3], 1e-3)
    tight(TURN, motion, (tip, grazing), 0.5e-3)
    assert (
        row_of(TURN, motion, (tip, sphere("grain", 0, [np.cos(1.0), np.sin(1.0), 0.0], 1e-3)), 0.0).verdict == VIOLATED
    )


@pytest.mark.parametrize("kind", ["box", "cylinder"])
def test_solids_without_a_radius_that_overlap_are_violated_at_clearance_zero(kind: str) -> None:
    def solid(name: str, joint: int, at: Any, size: float) -> Body:
        if kind == "box":
            return box(name, joint, at, np.full(3, size))
        return cylinder(name, joint, at - 0.5 * size * Z, at + 0.5 * size * Z, 0.5 * size)

    wall = solid("wall", 0, 1.0 * X, 0.4)
    for size, reach in ((0.2, 1.0), (0.2, 0.75), (0.2, 0.71), (1.5, 1.0)):  # inside, through, just, around
        row = row_of(SLIDE, line([-2.0], [reach]), (solid("a", 1, 0.0 * X, size), wall), 0.0)
        assert row.verdict == VIOLATED and row.attained < 0.0, (size, reach, row)
    row = row_of(SLIDE, line([-2.0], [0.69]), (solid("a", 1, 0.0 * X, 0.2), wall), 0.0)
    assert row.verdict == PROVED


def test_what_starts_inside_is_violated_and_ends_soon() -> None:
    row = row_of(SLIDE, line([0.0], [1.0]), (sphere("a", 1, 0.0 * X, 0.2), sphere("b", 0, 0.0 * X, 0.3)), 0.0)
    assert row.verdict == VIOLATED and row.attained <= -0.5 + 1e-12 and row.boxes < 200
    capsules = capsule("a", 1, -Y, Y, 0.1), capsule("b", 0, -Z, Z, 0.1)  # their axes cross
    row = row_of(SLIDE, line([-1.0], [1.0]), capsules, 0.01)
    assert row.verdict == VIOLATED and row.attained <= -0.2 + 1e-9 and row.boxes < 2000


def test_angles_beyond_what_sines_resolve_are_not_proved() -> None:
    bodies = sphere("a", 1, X, 0.1), sphere("b", 0, 2.5 * X, 0.1)
    row = row_of(TURN, line([1e7], [1e7 + 1.0], of=TURN), bodies, 0.1, max_arcs=200)
    assert row.verdict == UNDECIDED


def test_a_bound_on_boxes_leaves_it_undecided() -> None:
    motion = line([0.0], [40.0 * np.pi], of=TURN)
    bodies = sphere("tip", 1, X, 1e-3), sphere("grain", 0, [0.0, 1.0, 2.5e-3], 1e-3)
    assert row_of(TURN, motion, bodies, 0.49e-3, max_arcs=20).verdict == UNDECIDED


def test_far_pairs_are_bounded_above_the_least_only() -> None:
    bodies = [sphere("a", 1, 0.0 * X, 0.1), *(sphere(f"b{k}", 0, [0.0, 1.0 + k, 0.0], 0.1) for k in range(4))]
    bodies = [bodies[0], *bodies[1:]]
    pairs = tuple((0, k) for k in range(1, 5))
    limit = ClearanceConstraint("clearance", SLIDE, tuple(bodies), pairs, 0.1)
    found = audit(line([-1.0], [1.0]), Requirements(SLIDE.joints, SLIDE.units, (), clearance_constraints=(limit,)))
    assert found.proved and [row.label for row in found.rows] == ["a - b0", "a - b1", "a - b2", "a - b3"]
    near, *far = found.rows
    assert near.attained - near.proved_bound <= clearance.WIDTH
    assert all(row.boxes == clearance.FIRST and row.proved_bound > near.attained for row in far)


def test_pairs_of_the_same_links_are_one_row() -> None:
    moving = sphere("m/0", 1, 0.0 * X, 0.1, "m"), sphere("m/1", 1, 0.3 * X, 0.1, "m")
    wall = box("w", 0, X + Y, [0.1, 0.1, 0.1])
    limit = ClearanceConstraint("clearance", SLIDE, (*moving, wall), ((0, 2), (1, 2)), 0.1)
    requirements = Requirements(SLIDE.joints, SLIDE.units, (), clearance_constraints=(limit,))
    (row,) = audit(line([-1.0], [0.0]), requirements).rows
    assert row.label == "m - w" and row.attained == pytest.approx(np.hypot(0.65, 0.95) - 0.1, abs=1e-6)
    several = audit_all([line([-1.0], [0.0]), line([-3.0], [-2.0])], requirements)
    assert [one.rows[0].attained for one in several] == [row.attained, pytest.approx(np.hypot(2.65, 0.95) - 0.1)]


def test_a_constraint_is_refused_in_one_line() -> None:
    a, b, c = sphere("a", 1, X, 0.1), sphere("b", 0, X, 0.1), sphere("c", 0, Y, 0.1)
    for bodies, pairs, asked, words in (
        ((a, b), (), 0.1, "no pairs"), ((a, b), ((0, 2),), 0.1, "not two of its 2 bodies"),
        ((a, b, c), ((1, 2),), 0.1, "do not move against each"), ((a, b), ((0, 1),), -0.1, "clearance is -0.1"),
        ((a, b), ((0, 1),), float("nan"), "clearance is nan"),
        ((a, sphere("c", 4, X, 0.1)), ((0, 1),), 0.1, "on joint 4"),
    ):  # fmt: skip
        with pytest.raises(ProblemDefinitionError, match=words):
            ClearanceConstraint("clearance", SLIDE, bodies, pairs, asked)
    limit = ClearanceConstraint("clearance", SLIDE, (a, b), ((0, 1),), 0.1)
    with pytest.raises(ProblemDefinitionError, match="robot with 1 joints; there are 2"):
        Requirements(("p", "q"), ("rad", "rad"), (), clearance_constraints=(limit,))
    with pytest.raises(ProblemDefinitionError, match="used 2 times"):
        Requirements(SLIDE.joints, SLIDE.units, (), clearance_constraints=(limit, limit))


# --- random motions ---


@pytest.mark.slow
def test_no_scan_contradicts_a_proof_and_no_violation_is_none() -> None:
    found = clearance_fuzz.main(24, 1)
    assert not found.faults
    verdicts = {verdict: number for (verdict, _), number in found.verdicts.items()}
    assert {PROVED, VIOLATED} <= set(verdicts) and len(found.robots) >= 10


@pytest.mark.parametrize("broken", ["still", "first order forgotten", "normals do not turn", "rounded inward"])
def test_proofs_that_are_false_are_found(broken: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A prover that takes bodies to stand still, or forgets a term, contradicts the scan."""
    bounds, apart = clearance.motion_bounds, separation.separation
    if broken == "still":
        monkeypatch.setattr(clearance, "motion_bounds", lambda *a: tuple(0.0 * part for part in bounds(*a)))
    elif broken == "first order forgotten":
        monkeypatch.setattr(clearance, "motion_bounds", lambda *a: (bounds(*a)[0], 0.02 * bounds(*a)[1]))
    elif broken == "normals do not turn":
        monkeypatch.setattr(clearance, "motion_bounds", lambda *a: (0.0 * bounds(*a)[0], 0.1 * bounds(*a)[1]))
    else:

        def inward(*arguments: Any) -> Any:
            found = apart(*arguments)
            return separation.Separation(found.normal, found.apart + 1e-4, found.clearance - 2e-4)

        monkeypatch.setattr(clearance, "separation", inward)
    tally = clearance_fuzz.Tally()
    tries = (clearance_fuzz.tried(np.random.default_rng([0, index]), tally) for index in range(40))
    assert any("FALSE" in fault for faults in tries for fault in faults)


def test_the_scan_knows_distances_that_are_known() -> None:
    pair = Pair(TURN.model, capsule("arm", 1, 0.0 * X, X, 0.1), box("b", 0, [0.0, 1.5, 0.0], [0.4, 0.2, 0.2]))
    assert pair.distance(np.array([np.pi / 2])) == pytest.approx(0.3, abs=1e-12)
    points = [np.array([[0.0], [np.pi]])]
    least, when = least_distance(pair, np.array([2.0]), points)
    assert least == pytest.approx(0.3, abs=1e-9) and when == pytest.approx(1.0, abs=1e-3)
    assert curve_at(np.array([2.0]), points, 1.0)[0] == pytest.approx(np.pi / 2)
