from itertools import product

import casadi
import numpy as np
import pytest

from ocp_traj.curves.bernstein import PiecewiseBezier, basis
from ocp_traj.curves.composition import compose
from ocp_traj.errors import ProblemDefinitionError

DEGREES = [(n, d) for n, d in product((1, 3, 5, 9), (1, 3, 5, 7)) if n * d <= 45]


def law(rng: np.random.Generator, degree: int) -> np.ndarray:
    return np.concatenate([[0.0], np.sort(rng.uniform(size=degree - 1)), [1.0]])


@pytest.mark.parametrize(("n", "d"), DEGREES)
def test_a_composition_is_the_path_at_the_laws_place(n: int, d: int) -> None:
    rng = np.random.default_rng(10 * n + d)
    for _ in range(20):
        path, s = rng.normal(size=(n + 1, 3)), law(rng, d)
        u = rng.uniform(size=50)
        place = basis(d, u) @ s
        found = compose(path, s)
        assert found.shape == (n * d + 1, 3)
        assert np.abs(basis(n * d, u) @ found - basis(n, place) @ path).max() <= 1e-13 * np.abs(path).max()


@pytest.mark.parametrize(("n", "d"), [(3, 3), (3, 5), (5, 7)])
def test_symbols_give_what_numbers_give(n: int, d: int) -> None:
    rng = np.random.default_rng(1)
    path, s = rng.normal(size=(n + 1, 2)), law(rng, d)
    x = casadi.SX.sym("x", d + 1)
    found = np.array(casadi.Function("f", [x], [compose(path, x)])(s))
    assert np.abs(found - compose(path, s)).max() <= 1e-15 * np.abs(path).max() * n * d


def test_derivatives_follow_the_chain_rule() -> None:
    rng = np.random.default_rng(2)
    path, s, duration, u = rng.normal(size=(4, 2)), law(rng, 5), 0.3, np.linspace(0.0, 1.0, 9)
    q = PiecewiseBezier([duration], (compose(path, s),))
    c, p = PiecewiseBezier([1.0], (path,)), PiecewiseBezier([duration], (s[:, None],))
    place = p.at(0, u)[:, 0]
    speed, acceleration = p.at(0, u, 1), p.at(0, u, 2)
    assert np.allclose(q.at(0, u, 1), c.at(0, place, 1) * speed, rtol=1e-11, atol=1e-11)
    expected = c.at(0, place, 2) * speed**2 + c.at(0, place, 1) * acceleration
    assert np.allclose(q.at(0, u, 2), expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("still", [1, 2, 3])
def test_rest_at_both_ends_is_exact(still: int) -> None:
    path = np.random.default_rng(3).normal(size=(4, 6))
    s = np.concatenate([np.zeros(still), [0.4], np.ones(still)])
    points = compose(path, s)
    assert (points[:still] == path[0]).all() and (points[-still:] == path[-1]).all()
    x = casadi.SX.sym("x")
    symbolic = compose(path, casadi.vertcat(*[0.0] * still, x, *[1.0] * still))
    assert not casadi.depends_on(casadi.vertcat(symbolic[:still, :], symbolic[-still:, :]), x)


def test_a_constant_is_no_path() -> None:
    with pytest.raises(ProblemDefinitionError, match="degree 1 or more"):
        compose(np.zeros((1, 2)), np.array([0.0, 1.0]))
