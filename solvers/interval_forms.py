"""Bounds of interval arithmetic over many boxes at once: products, sums and the mean value form, rounded outward."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.interval.tape import Tape

Pair = tuple[Any, Any]


def outward(lower: Any, upper: Any) -> Pair:
    """Ends, of one rounding each, as bounds."""
    return np.nextafter(lower, -np.inf), np.nextafter(upper, np.inf)


def product(a: Pair, b: Pair) -> Pair:
    """Enclosure of products; infinite where an end is not known."""
    corners = np.stack(np.broadcast_arrays(a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1]))
    unknown = np.isnan(corners).any(axis=0)
    low, high = outward(corners.min(axis=0), corners.max(axis=0))
    return np.where(unknown, -np.inf, low), np.where(unknown, np.inf, high)


def total_of(pairs: Sequence[Pair]) -> Pair:
    """Enclosure of a sum."""
    low, high = pairs[0]
    for a, b in pairs[1:]:
        low, high = outward(low + a, high + b)
    return low, high


def mean_value(value: Tape, slopes: Tape, box: Pair, centre: Array, *fixed: Array) -> Pair:
    """Enclosure of rows over boxes by their mean value form, and by the tape itself.

    Args:
        value: tape (y, fixed ..) -> rows.
        slopes: tape (y, fixed ..) -> their Jacobian with respect to y, column-major.
        box: ends of y ``(n, N)`` each.
        centre: a point of each box ``(n, N)``.
        fixed: further arguments, numbers ``(.., N)``.
    """
    given = [(number, number) for number in fixed]
    spread = outward(box[0] - centre, box[1] - centre)
    start, plain = value.enclose((centre, centre), *given)[0], value.enclose(box, *given)[0]
    gradients = grouped(slopes.enclose(box, *given), len(start[0]))
    change = total_of([product(slope, (c[None], d[None])) for slope, c, d in zip(gradients, *spread, strict=True)])
    form = outward(start[0] + change[0], start[1] + change[1])
    return np.fmax(form[0], plain[0]), np.fmin(form[1], plain[1])


def grouped(outputs: Sequence[Pair], count: int) -> list[Pair]:
    """Slopes by variable, from a column-major Jacobian."""
    low, high = outputs[0]
    return [(low[i : i + count], high[i : i + count]) for i in range(0, len(low), count)]
