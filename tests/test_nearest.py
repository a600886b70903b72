"""Nearest points and features of cores: where bodies overlap or nearly, and of edges that are parallel or nearly."""

import numpy as np
import pytest

from ocp_traj.arrays import Array
from ocp_traj.robot.bodies import Body, box, capsule, cylinder
from ocp_traj.robot.cores import Cores, group_of
from ocp_traj.robot.nearest_features import nearest_features
from ocp_traj.robot.nearest_points import nearest
from tests.independent.bodies import extent
from tests.test_bodies import some

TURN = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
TURN = TURN * np.linalg.det(TURN)  # a rotation


def at_rest(bodies: list[Body]) -> Cores:
    half = np.array([b.half for b in bodies])
    return Cores(
        np.array([group_of(b) for b in bodies]), np.array([b.centre for b in bodies]),
        np.array([b.axes for b in bodies]), np.where(np.isfinite(half), half, 0.0),
    )  # fmt: skip


def least_along(one: Body, two: Body, normal: Array) -> float:
    """The least normal . (x - y) over points x and y of the cores."""
    along = float(normal @ (one.centre - two.centre))
    return along - extent(one, one.axes.T @ normal) - extent(two, two.axes.T @ normal)


def moved(body: Body, centre: Array) -> Body:
    return Body(body.name, body.kind, body.joint, centre, body.axes, body.half, body.radius)


@pytest.mark.parametrize(
    ("first", "second", "gap"),
    [("box", "box", 1e-11), ("cylinder", "box", 1e-11), ("capsule", "cylinder", 1e-11), ("cylinder", "cylinder", 1e-6)],
)
def test_either_a_common_point_or_a_direction_that_separates(first: str, second: str, gap: float) -> None:
    """Of bodies near one another, half of which overlap, each pair is told rightly: what is found shows it."""
    rng, count = np.random.default_rng(7), 300
    ones, twos = ([some(rng, kind) for _ in range(count)] for kind in (first, second))
    twos = [moved(two, one.centre + 0.3 * (two.centre - one.centre)) for one, two in zip(ones, twos, strict=True)]
    meeting = 0
    for one, two, x, y, normal in zip(ones, twos, *nearest(at_rest(ones), at_rest(twos)), strict=True):
        for body, point in ((one, x), (two, y)):
            local = np.abs(body.axes.T @ (point - body.centre))
            if body.kind == "cylinder":
                local = np.array([np.hypot(local[0], local[1]), 0.0, local[2]])
            assert (local <= body.half + 1e-12).all()
        distance = float(np.linalg.norm(x - y))
        if distance > 1e-9:
            assert distance - least_along(one, two, normal) <= gap
        meeting += distance <= 1e-9
    assert count / 10 < meeting < count * 9 / 10


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-6, 1e-4, 1e-3])
def test_nearly_parallel_segments_are_as_near_as_they_are(angle: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        shift, height = rng.uniform(-0.3, 0.3), rng.uniform(0.01, 0.2)
        ends = np.array([[-0.2, 0.0, 0.0], [0.2, 0.0, 0.0]])
        lean = rng.normal(size=3) * angle
        others = ends + [shift, 0.0, height] + np.array([[-0.2], [0.2]]) * lean
        one, two = (capsule("c", 0, *(points @ TURN.T), 0.01) for points in (ends, others))
        found = nearest_features(at_rest([one]), at_rest([two]))
        assert found.distance[0] - least_along(one, two, found.normal[0]) <= 1e-13
        if angle == 0.0:  # the middle of where they face one another
            low, high = max(-0.2, shift - 0.2), min(0.2, shift + 0.2)
            assert found.point_b[0] == pytest.approx(TURN @ [0.5 * (low + high), 0.0, height], abs=1e-12)


def test_along_a_face_it_is_the_middle_that_is_nearest() -> None:
    rng = np.random.default_rng(4)
    for _ in range(50):
        shift, height = rng.uniform(-0.4, 0.4), rng.uniform(0.21, 0.5)
        ends = np.array([[shift - 0.2, 0.0, height], [shift + 0.2, 0.0, height]])
        rod, crate = capsule("c", 0, *(ends @ TURN.T), 0.01), box("b", 0, np.zeros(3), [0.6, 0.4, 0.4], TURN)
        found = nearest_features(at_rest([rod]), at_rest([crate]))
        low, high = max(-0.3, shift - 0.2), min(0.3, shift + 0.2)
        assert found.point_a[0] == pytest.approx(TURN @ [0.5 * (low + high), 0.0, height], abs=1e-12)
        assert found.flat[0] == 1.0 and found.distance[0] == pytest.approx(height - 0.2, abs=1e-14)


def test_a_disc_that_pierces_a_plate_with_its_rim_meets_it() -> None:
    """Its axis is far from the plate, its furthest points are beyond it, and no edge of the plate is met."""
    disc = cylinder("d", 0, TURN @ [0.0, -0.001, 0.0], TURN @ [0.0, 0.001, 0.0], 0.5)
    for depth in (0.004, 0.01, 0.05):
        plate = box("p", 0, TURN @ [0.0, 0.0, -0.5 + depth], [1.0, 1.0, 0.002], TURN)
        x, y, _ = nearest(at_rest([disc]), at_rest([plate]))
        assert x[0] == pytest.approx(y[0], abs=1e-12)
    plate = box("p", 0, TURN @ [0.0, 0.0, -0.502], [1.0, 1.0, 0.002], TURN)
    x, y, _ = nearest(at_rest([disc]), at_rest([plate]))
    assert np.linalg.norm(x - y) == pytest.approx(0.001, abs=1e-12)
