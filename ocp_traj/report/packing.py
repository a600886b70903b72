"""Arrays in JSON: little-endian bytes as base64, so that a page reads them fast and bit by bit."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array

KINDS = {"f8": "<f8", "f4": "<f4"}


def packed(values: ArrayLike, kind: str = "f8") -> dict[str, Any]:
    """An array as ``{kind: base64, "shape": [..]}``.

    Args:
        values: of any shape.
        kind: ``f8`` (exact) or ``f4`` (for what is drawn and not computed with).
    """
    array = np.asarray(values, dtype=KINDS[kind])
    return {kind: base64.b64encode(array.tobytes()).decode("ascii"), "shape": list(array.shape)}


def unpacked(data: dict[str, Any]) -> Array:
    """The array of ``packed``."""
    kind = next(name for name in KINDS if name in data)
    flat = np.frombuffer(base64.b64decode(data[kind]), dtype=KINDS[kind])
    return flat.reshape(data["shape"]).astype(float)
