"""What a certificate leaves between its staircases, shaded in the picture of a front."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ocp_traj.arrays import Array
from ocp_traj.io.plot_style import ORANGE
from ocp_traj.results.front_certificate import FrontCertificate
from ocp_traj.rounding import rounded_up

BETWEEN, FORBIDDEN = ORANGE, "0.35"
ROOM = 0.05  # of the front's range, on each side of it: our choice


def shade(axes: Axes, certificate: FrontCertificate, first: str) -> None:
    """Shades what lies between the staircases, within a little more than the range of the attained points.

    Args:
        axes: with the objective ``first`` to the right and the other one upwards.
        certificate: of the front that is drawn.
        first: id of an objective.
    """
    worst = np.array([certificate.reference[name] for name in certificate.objectives])
    grid, lower = _steps(certificate.bound, worst)
    known, upper = _steps(certificate.attained, worst)
    places = np.union1d(grid, known)
    low, high = (_at(places, *stairs, float(worst[1])) for stairs in ((grid, lower), (known, upper)))
    words = f"not decided: at most {rounded_up(100.0 * certificate.gap, 3):.3g} % of the hypervolume"
    bound = "no trajectory is below"
    style: dict[str, Any] = {"color": BETWEEN, "alpha": 0.6, "linewidth": 0, "zorder": 1, "label": words}
    line: dict[str, Any] = {"color": FORBIDDEN, "linewidth": 0.9, "zorder": 1, "label": bound}
    if first == certificate.objectives[0]:
        axes.fill_between(places, low, high, step="post", **style)
        axes.step(np.append(places[0], places), np.append(worst[1], low), where="post", **line)
    else:
        axes.fill_betweenx(places, low, high, step="post", **style)
        axes.step(np.append(worst[1], low), np.append(places[0], places), where="pre", **line)
    points = certificate.attained
    if len(points):
        ends = np.stack([points.min(axis=0), points.max(axis=0)])
        room = ROOM * np.maximum(np.ptp(ends, axis=0), 1e-9 * np.abs(ends).max(axis=0))
        (x, y) = np.stack([ends[0] - room, ends[1] + room], axis=1)
        axes.set_xlim(*(x if first == certificate.objectives[0] else y))
        axes.set_ylim(*(y if first == certificate.objectives[0] else x))


def _steps(corners: Array, worst: Array) -> tuple[Array, Array]:
    """Places and values of a staircase, the reference included."""
    whole = np.vstack([corners, [worst[0], corners[-1, 1] if len(corners) else worst[1]]])
    return whole[:, 0], whole[:, 1]


def _at(places: Array, corners: Array, values: Array, outside: float) -> Array:
    """The value of a staircase at places; before its first corner the reference."""
    index = np.searchsorted(corners, places, side="right") - 1
    return np.where(index < 0, outside, values[np.maximum(index, 0)])
