"""A Hessian while it is summed, from small ones of segments."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.transcription.shape import ShapeAt


class HessianSum:
    """The Hessian of a weighted sum of functions of a curve, while it is summed.

    Attributes:
        local: in the variables of each segment, the curve's own bend left out ``(K, m, m)``.
        points, durations, parameters: weights of the curve's bend ``(K, most + 1, dof)``, ``(K,)``, ``(K, n_p)``.
        nonzeros: what is known nonzero by nonzero.
    """

    def __init__(self, at: ShapeAt, nonzeros: int) -> None:
        """Begins with zero."""
        segments, width = at.shape.columns.shape
        self.local = np.zeros((segments, width, width))
        self.points, self.durations, self.parameters = (
            np.zeros_like(v) for v in (at.points, at.durations, at.parameters)
        )
        self.nonzeros = np.zeros(nonzeros)


def distinct(keys: Index) -> Index:
    """The keys >= 0 ``(N,)`` in order, each once; NumPy's own way by a hash is slow where keys are spread evenly."""
    ordered = np.sort(keys)
    return ordered[np.flatnonzero((ordered >= 0) & (np.diff(ordered, prepend=-1) != 0))]


def gathered(places: Index, values: Array, size: int) -> Array:
    """Sum of values by place; those at -1 are left out."""
    kept = places >= 0
    return np.bincount(places[kept], weights=values[kept], minlength=size).astype(float, copy=False)
