"""Where a front has most to gain: shares of a box against exact hypervolumes, and a sphere traced by its geometry."""

from itertools import combinations

import moocore
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from ocp_traj.blas import one_blas_thread
from ocp_traj.solvers.front_directions import DRAWN, OpenBox, dominance, greedy, well_spread

# A count over a low-discrepancy sequence of 8192 points is within this of the volume, with room: plain Monte Carlo's
# standard deviation is 0.0055 at most.
CLOSE = 0.015


def box(m: int) -> OpenBox:
    """A box that is no unit box, so that units matter."""
    return OpenBox(np.arange(m) - 1.0, np.arange(m) + 1.0 + np.arange(m))


def random_points(m: int, count: int, seed: int) -> np.ndarray:
    one = box(m)
    return one.ideal + np.random.default_rng(seed).uniform(0.1, 0.9, (count, m)) * one.span


@pytest.mark.parametrize("m", [2, 3, 4, 6])
def test_what_a_point_gains_alone_is_the_volume_between_it_and_the_reference(m: int) -> None:
    points = random_points(m, 20, m)
    units = (points - box(m).ideal) / box(m).span
    assert box(m).gains(points) == pytest.approx((1.0 - units).prod(axis=1), abs=CLOSE)


@pytest.mark.parametrize("m", [2, 3, 4, 6])
def test_the_share_that_is_dominated_is_the_hypervolume(m: int) -> None:
    one, points = box(m), random_points(m, 30, m)
    one.add(points)
    exact = moocore.hypervolume((points - one.ideal) / one.span, ref=np.ones(m))
    assert one.hypervolume == pytest.approx(exact, abs=CLOSE)
    one.refill()
    assert one.hypervolume == pytest.approx(exact, abs=CLOSE)


def test_a_point_adds_what_it_was_said_to_gain_and_then_nothing_more() -> None:
    one = box(3)
    for point in random_points(3, 10, 1):
        (gain,), before = one.gains(point[None]), one.hypervolume
        one.add(point)
        assert one.hypervolume - before == pytest.approx(gain, abs=1e-12)
        assert one.gains(point[None])[0] == 0.0


def test_targets_are_open_and_none_decides_another() -> None:
    one = box(3)
    points = random_points(3, 6, 2)
    one.add(points)
    corner = one.ideal + 0.1 * one.span
    one.close(corner)
    targets = one.next_targets(8)
    assert len(targets) == 8
    assert not dominance(points, targets).any()
    assert not (targets < corner).all(axis=1).any()
    assert (dominance(targets, targets) == np.eye(8, dtype=bool)).all()
    assert_array_equal(targets, one.next_targets(8))


def test_nothing_is_left_where_all_is_below_a_corner_or_dominated() -> None:
    for decide in (lambda b: b.close(b.ideal + b.span), lambda b: b.add(b.ideal[None])):
        one = box(4)
        decide(one)
        one.refill()
        assert one.undecided == 0.0
        assert len(one.next_targets(3)) == 0


def test_a_corner_below_which_a_point_is_found_was_none() -> None:
    one, other = box(3), box(3)
    middle = one.ideal + 0.5 * one.span
    one.close(middle)
    assert one.undecided == pytest.approx(7 / 8, abs=CLOSE)
    better = one.ideal + 0.25 * one.span
    for each in (one, other):
        each.add(better)
        each.refill()
    assert len(one.corners) == 0
    assert one.undecided == pytest.approx(other.undecided, abs=CLOSE)
    assert other.undecided == pytest.approx(1.0 - 0.75**3, abs=CLOSE)


def test_the_front_itself_contradicts_no_corner_that_it_ends_at() -> None:
    one = box(3)
    point = one.ideal + np.array([0.3, 0.5, 0.4]) * one.span
    one.close(point)
    one.add(point)
    assert len(one.corners) == 1


@pytest.mark.parametrize(
    ("m", "true", "left"), [(2, 1.0 - np.pi / 4.0, 0.03), (3, 1.0 - np.pi / 6.0, 0.2), (4, 1.0 - np.pi**2 / 32.0, 0.4)]
)
@one_blas_thread
def test_a_sphere_is_enclosed_between_what_is_had_and_what_is_open(m: int, true: float, left: float) -> None:
    """Aiming at it, each solve by a formula: z = s + g (1, .., 1) with |z| = 1. The dominated share is known."""
    one = OpenBox(np.zeros(m), np.ones(m))
    one.add(np.eye(m))
    for _ in range(6):
        for s in one.next_targets(8):
            g = (-s.sum() + np.sqrt(s.sum() ** 2 - m * (s @ s - 1.0))) / m
            z = s + g
            one.close(z)
            if (z <= 1.0).all():
                one.add(z)
        one.refill()
        assert one.hypervolume - CLOSE <= true <= one.hypervolume + one.undecided + CLOSE
    assert one.undecided < left


def test_the_greedy_choice_is_that_of_its_definition_and_near_the_best() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        covers = rng.uniform(size=(8, 60)) < 0.2
        taken = greedy(covers, most=3)
        left = np.ones(60, dtype=bool)
        for row, adds in taken:
            assert adds == (covers & left).sum(axis=1).max() == (covers[row] & left).sum()
            left &= ~covers[row]
        best = max(covers[list(some)].any(axis=0).sum() for some in combinations(range(8), 3))
        assert sum(adds for _, adds in taken) >= (1.0 - 1.0 / np.e) * best


def test_the_greedy_choice_ends_where_less_is_added_than_is_asked_for() -> None:
    covers = np.array([[1, 1, 1, 0, 0, 0], [0, 0, 1, 1, 1, 0], [0, 0, 0, 0, 1, 1], [0, 0, 1, 0, 0, 0]], dtype=bool)
    assert greedy(covers, least=2) == [(0, 3), (1, 2)]
    assert greedy(covers) == [(0, 3), (1, 2), (2, 1)]
    assert greedy(covers, first=np.array([3])) == [(3, 1), (0, 2), (1, 2), (2, 1)]
    assert greedy(np.zeros((0, 6), dtype=bool)) == []


def test_points_that_are_kept_dominate_more_than_random_ones_with_the_ends_among_them() -> None:
    rng = np.random.default_rng(6)
    values = np.abs(rng.standard_normal((300, 3)))
    values /= np.linalg.norm(values, axis=1)[:, None]
    ends = np.unique(values.argmin(axis=0))
    corners = np.zeros(3), np.full(3, 1.1)
    kept = well_spread(values, *corners, 20, ends)
    assert len(kept) == len(set(kept.tolist())) == 20 and set(ends) <= set(kept)
    ours = moocore.hypervolume(values[kept], ref=corners[1])
    others = [moocore.hypervolume(values[rng.choice(300, 20, replace=False)], ref=corners[1]) for _ in range(50)]
    assert ours > max(others)
    assert_array_equal(well_spread(values[:5], *corners, 20, ends[:0]), np.arange(5))


def test_samples_are_drawn_until_enough_are_open_and_are_the_same_each_time() -> None:
    one, other = box(4), box(4)
    for each in (one, other):
        each.add(each.ideal + 0.2 * each.span)
        each.refill()
    assert len(one.open) >= DRAWN
    assert_array_equal(one.open, other.open)
