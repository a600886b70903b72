"""Proved trajectories put into a running population, and what becomes of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pymoo.core.population import Population as PymooPopulation

from ocp_traj.arrays import Array
from ocp_traj.evolution.evolution import PymooProblem


def inject(algorithm: Any, target: PymooProblem, xs: Sequence[Array]) -> None:
    """Puts decision vectors ``(n,)`` among an algorithm's population, as if they were one more offspring.

    They are proved, so they meet every limit, whatever a parabola between two instants makes of them; only the
    reference point is asked of them as of all others. Particles start at rest.

    Args:
        algorithm: of pymoo, NSGA-II, NSGA-III or CMOPSO, between two generations.
        target: its problem.
        xs: proved.
    """
    if not len(xs):
        return
    x = np.array(xs, dtype=float)
    f = target.population.evaluate(x, limits=False).objectives * target.signs
    beyond = target.beyond(f)
    limits = target.n_ieq_constr - beyond.shape[1] if target.n_ieq_constr else 0
    g = np.concatenate([np.zeros((len(x), limits)), beyond], axis=1) if target.n_ieq_constr else np.zeros((len(x), 0))
    excess = np.maximum(beyond, 0.0).sum(axis=1)
    new = PymooPopulation.new(X=x)
    for name, values in {"F": target.handled(f, excess), "G": g, "excess": excess, "V": np.zeros_like(x)}.items():
        new.set(name, values)
    new.set("H", np.zeros((len(x), 0)))
    for individual in new:
        individual.evaluated.update(("F", "G", "H", "excess"))
    algorithm._advance(infills=new)  # noqa: SLF001  # pymoo has no other way in between two generations
    algorithm._set_optimum()  # noqa: SLF001


def keys(xs: Sequence[Array]) -> set[bytes]:
    """Of decision vectors, for comparison bit by bit."""
    return {np.asarray(x, dtype=float).tobytes() for x in xs}


def alive(algorithm: Any, wanted: set[bytes]) -> int:
    """How many of some decision vectors, by their ``keys``, are in the population."""
    return len(wanted & keys(list(algorithm.pop.get("X").astype(float))))
