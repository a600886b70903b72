"""A Hessian while it is summed, from small ones of segments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ocp_traj.transcription.derivative_values import DerivativeValuesAt
from ocp_traj.transcription.instant_values import InstantValuesAt
from ocp_traj.transcription.shape import ShapeAt

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class HessianSum:
    """A Hessian while it is summed: by segment, of the curve's bend, and nonzero by nonzero."""

    def __init__(self, at: ShapeAt, nonzeros: int) -> None:
        segments, width = at.shape.columns.shape
        self.local = np.zeros((segments, width, width))
        self.points, self.durations, self.parameters = (
            np.zeros_like(v) for v in (at.points, at.durations, at.parameters)
        )
        self.nonzeros = np.zeros(nonzeros)

    def add(self, values: InstantValuesAt | DerivativeValuesAt, weights: Array) -> None:
        """Adds the second derivatives of values at instants times weights ``(N, rows)``."""
        found = values.curvature(weights)
        self.local += found.local
        self.points += found.points
        self.durations += found.durations
        self.parameters += found.parameters


def distinct(keys: Index) -> Index:
    """The keys >= 0 ``(N,)`` in order, each once; NumPy's own way by a hash is slow where keys are spread evenly."""
    ordered = np.sort(keys)
    return ordered[np.flatnonzero((ordered >= 0) & (np.diff(ordered, prepend=-1) != 0))]


def gathered(places: Index, values: Array, size: int) -> Array:
    """Sum of values by place; those at -1 are left out."""
    kept = places >= 0
    return np.bincount(places[kept], weights=values[kept], minlength=size).astype(float, copy=False)
