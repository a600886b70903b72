"""Seams: distances to both tubes, arc lengths by fine chords, normals by finite differences."""

from math import pi
from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from ocp_traj.errors import InputError
from ocp_traj.paths.pieces import Pieces, at_piece, pieces
from ocp_traj.paths.polyline_seam import PolylineSeam
from ocp_traj.paths.seam import Placement, Seam, TubeSeam

R, BRACE = 0.150, 0.090


def tube(psi: float, phi: tuple[float, float] = (-pi / 2, pi / 2), **more: object) -> TubeSeam:
    return TubeSeam(R, BRACE, np.radians(psi), phi, **more)  # type: ignore[arg-type]


def noisy(seed: int) -> PolylineSeam:
    """A seam through measured points: noise of 0.01 to 1 mm, of 0.02 rad on the normals."""
    rng = np.random.default_rng(seed)
    size, count = 10.0 ** rng.uniform(-5.0, -3.0), int(rng.integers(20, 80))
    t = np.linspace(0.0, 1.0, count)
    points = np.stack([0.3 * t, 0.05 * np.sin(3.0 * t), 0.02 * t**2], axis=1) + size * rng.normal(size=(count, 3))
    return PolylineSeam(points, [0.0, 0.0, -1.0] + 0.02 * rng.normal(size=(count, 3)))


@pytest.mark.parametrize(("psi", "length"), [(90.0, 0.5809), (60.0, 0.6265), (45.0, 0.7054)])
def test_lengths_of_whole_seams(psi: float, length: float) -> None:
    assert tube(psi, (-pi, pi)).length == pytest.approx(length, abs=5e-5)


@pytest.mark.parametrize("psi", [90.0, 60.0, 45.0, 30.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_tubular_seam_lies_on_both_tubes(psi: float, mirrored: bool) -> None:
    place = Placement((0.3, -0.2, 0.7), 0.8)
    seam = tube(psi, (-2.5, 3.0), place=place, mirrored=mirrored)
    s = np.linspace(0.0, seam.length, 500)
    c, d = np.cos(0.8), np.sin(0.8)
    points = (seam.at(s).position - [0.3, -0.2, 0.7]) @ np.array([[c, -d, 0.0], [d, c, 0.0], [0.0, 0.0, 1.0]])
    assert_allclose(np.hypot(points[:, 1], points[:, 2]), R, rtol=1e-12)
    lean = -1.0 if mirrored else 1.0
    axis = np.array([lean * np.cos(np.radians(psi)), 0.0, np.sin(np.radians(psi))])
    off = points - (points @ axis)[:, None] * axis
    assert_allclose(np.linalg.norm(off, axis=1), BRACE, rtol=1e-12)


def test_a_seam_is_run_at_unit_speed_and_the_torch_is_across_it() -> None:
    seam = tube(60.0, (1.9, -2.2))
    h = 1e-5
    s = np.linspace(2 * h, seam.length - 2 * h, 400)
    ahead, behind, here = seam.at(s + h), seam.at(s - h), seam.at(s)
    slope = (ahead.position - behind.position) / (2 * h)
    assert_allclose(slope, here.tangent, rtol=0, atol=1e-7)  # O(h^2) and eps / h
    assert np.abs((here.tangent * here.axis).sum(axis=1)).max() < 1e-12
    assert_allclose(np.linalg.norm(here.axis, axis=1), 1.0, rtol=1e-12)
    chords = np.linalg.norm(np.diff(seam.at(np.linspace(0, seam.length, 20001)).position, axis=0), axis=1)
    assert chords.sum() == pytest.approx(seam.length, rel=1e-8)


def test_normals_stand_on_the_walls_and_the_dihedral_is_between_them() -> None:
    seam = tube(60.0, (-pi, pi))
    s = np.linspace(0.0, seam.length, 200)
    here, phi = seam.at(s), seam.angle(s)
    for normal in seam.normals(phi):
        assert np.abs((normal * here.tangent).sum(axis=1)).max() < 1e-12
        assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-12)
    middle = seam.length / 2  # phi = 0, where the brace leans over the chord: psi, and opposite its supplement
    assert np.degrees(seam.dihedral([middle]))[0] == pytest.approx(60.0, abs=1e-6)
    assert np.degrees(seam.dihedral([0.0]))[0] == pytest.approx(120.0, abs=1e-6)


def off(seam: Seam, cut: Pieces, samples: int) -> tuple[float, float]:
    """Largest distance of place and axis from the polynomials that is found at samples of the whole arc."""
    s = np.linspace(0.0, seam.length, samples)
    exact, piece = seam.at(s), np.minimum((s / seam.length * (len(cut.tags) - 1)).astype(int), len(cut.tags) - 2)
    place, axis = np.empty((samples, 3)), np.empty((samples, 3))
    for k in range(len(cut.tags) - 1):
        here = piece == k
        place[here], axis[here] = cut.values(k, (s[here] - cut.tags[k]) / (cut.tags[k + 1] - cut.tags[k]))
    return (
        float(np.linalg.norm(place - exact.position, axis=1).max()),
        float(np.linalg.norm(axis - exact.axis, axis=1).max()),
    )


@pytest.mark.parametrize("psi", [90.0, 60.0, 45.0])
def test_pieces_follow_the_seam_to_what_they_say(psi: float) -> None:
    seam = tube(psi)
    cut = pieces(seam, 9)
    assert cut.position_error < 2e-10
    assert_allclose(np.diff(cut.tags), seam.length / 8, rtol=1e-12)
    symbols = ca.SX.sym("c", cut.constants.shape[1]), ca.SX.sym("u")
    function = ca.Function("f", list(symbols), list(at_piece(*symbols)))
    for k, u in enumerate(np.random.default_rng(0).uniform(size=8)):
        place, axis = cut.values(k, u)
        found = [np.array(v).ravel() for v in function(cut.constants[k], u)]
        assert_allclose(found, [place[0], axis[0]], rtol=0, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seam", "tags"),
    [
        (tube(30.0), 9),
        (tube(60.0, (1.9, -2.2), mirrored=True, place=Placement((0.3, -0.2, 0.7), 0.8)), 5),
        (TubeSeam(0.1, 0.1, 1.0, (-pi / 2, pi / 2)), 9),  # of one radius, a kink at either end
        (TubeSeam(0.1, 0.1, 1.0, (-2.0, 2.0)), 9),  # and within pieces
        *((noisy(seed), 9) for seed in range(5)),
    ],
)
def test_errors_of_pieces_are_bounds_and_close_ones(seam: Seam, tags: int) -> None:
    cut = pieces(seam, tags)
    for bound, found in zip((cut.position_error, cut.axis_error), off(seam, cut, 20_000), strict=True):
        assert found <= bound <= 1.03 * found + 2e-10


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5, 15))
def test_errors_of_pieces_hold_for_many_noisy_seams(seed: int) -> None:
    seam = noisy(seed)
    cut = pieces(seam, 9)
    for bound, found in zip((cut.position_error, cut.axis_error), off(seam, cut, 200_000), strict=True):
        assert found <= bound <= 1.03 * found + 2e-10


@pytest.mark.slow
def test_a_polyline_is_its_points_and_a_circle_comes_out_round(tmp_path: Path) -> None:
    angle = np.linspace(0.0, pi, 41)
    points = np.stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), np.full(41, 0.5)], axis=1)
    normals = np.stack([np.cos(angle), np.sin(angle), np.ones(41)], axis=1)
    table = pd.DataFrame(np.hstack([points, normals]), columns=["x [m]", "y [m]", "z [m]", "nx", "ny", "nz"])
    table.to_csv(tmp_path / "seam.csv", index=False)
    seam = PolylineSeam.read(tmp_path / "seam.csv", Placement((1.0, 0.0, 0.0), pi / 2))
    assert seam.length == pytest.approx(0.2 * pi, rel=1e-7)
    here = seam.at(np.linspace(0.0, seam.length, 300))
    assert_allclose(np.hypot(here.position[:, 0] - 1.0, here.position[:, 1]), 0.2, rtol=1e-6)
    out = (here.position - [1.0, 0.0, 0.5]) / 0.2
    assert_allclose(here.axis, -(out + [0.0, 0.0, 1.0]) / np.sqrt(2.0), atol=1e-5)
    assert pieces(seam, 9).position_error < 1e-6


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: TubeSeam(0.1, 0.2, 1.0, (0.0, 1.0)), "0 < brace <= chord"),
        (lambda: TubeSeam(0.2, 0.1, 2.0, (0.0, 1.0)), "psi is 114.592 deg"),
        (lambda: TubeSeam(0.2, 0.1, 1.0, (0.0, 7.0)), "at most one turn apart"),
        (lambda: tube(60.0).at([1.0]), "has no place at"),
        (lambda: pieces(tube(60.0), 1), "give two or more"),
        (lambda: PolylineSeam(np.zeros((6, 3)), np.ones((6, 3))), "points 1 and 2 of a seam are the same"),
        (lambda: PolylineSeam(np.eye(3), np.eye(3)), "six or more"),
        (lambda: PolylineSeam.read("nowhere.csv"), "cannot read the seam file nowhere.csv: No such file"),
    ],
)
def test_what_is_no_seam_is_refused(make: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()  # type: ignore[operator]
