"""Corners of tool paths rounded: arcs that touch both lines, well inside balls in which the tool may leave them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.paths.cartesian import SMOOTH, Ball, Section, ToolPath

INSIDE = 0.5  # of the ball's radius, and of the tolerance of tilt, that an arc uses: our choice
SHARPEST = np.radians(170.0)  # turn of the path at a corner: what is sharper is hardly a corner that can be rounded


def blended(sections: Sequence[Section], radii: Sequence[float], tilt: float) -> ToolPath:
    """The path along sections whose corners are rounded.

    Args:
        sections: each from where the one before ends.
        radii: of each section, of the ball about the corner at which it begins [m]; zero for a corner that stays.
        tilt: angle by which the tool may be turned from how it is at the corner, within the ball [rad].
    """
    cuts, arcs = np.zeros((len(sections), 2)), {}
    for k in range(1, len(sections)):
        if radii[k] > 0.0 and k in ToolPath(tuple(sections)).corners:
            arcs[k] = _reach(sections[k - 1], sections[k], radii[k], tilt)
            cuts[k - 1, 1] = cuts[k, 0] = arcs[k]
    found: list[Section] = []
    for k, section in enumerate(sections):
        low, high = cuts[k, 0], section.length - cuts[k, 1]
        part = section if high - low == section.length else _part(section, low, high)
        if k in arcs:
            found.append(_arc(found[-1], part, section.start, radii[k]))
        found.append(part)
    return ToolPath(tuple(found))


def _reach(before: Section, after: Section, radius: float, tilt: float) -> float:
    """The distance from the corner at which an arc begins and ends [m]."""
    if before.curvature or after.curvature:
        raise InputError("its blend is at the end of an arc; it rounds the corner between two lines: leave it out")
    shorter = min(before.length, after.length)
    if not radius <= 0.5 * shorter:
        raise InputError(
            f"its blend is {radius:g} m, at the corner of a line of {shorter:g} m; give at most half of that"
        )
    turn = float(np.arccos(np.clip(before.tangent @ after.tangent, -1.0, 1.0)))
    if turn > SHARPEST:
        raise InputError(
            f"its path turns back by {np.degrees(turn):.4g} degrees at the corner of its blend, which rounds corners "
            f"of up to {np.degrees(SHARPEST):.4g}; leave it out: the tool stops there"
        )
    rate = max(float(np.linalg.norm(section.turn)) / section.length for section in (before, after))
    return INSIDE * min(radius, tilt / rate if rate > 0.0 else np.inf)


def _part(section: Section, low: float, high: float) -> Section:
    """A line between two lengths of it [m]."""
    share = (high - low) / section.length
    return replace(section, start=section.at(low), length=high - low, turn=section.turn * share)


def _arc(before: Section, after: Section, corner: pin.SE3, radius: float) -> Section:
    """From the end of a line to the beginning of another, round a corner."""
    begin = before.at(before.length)
    turn = np.asarray(pin.log3(after.start.rotation @ begin.rotation.T))
    axis: Array = np.cross(before.tangent, after.tangent)
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, before.tangent @ after.tangent))
    reach = float(np.linalg.norm(corner.translation - begin.translation))
    ball = Ball(corner, radius)
    if angle < SMOOTH:  # the tool's turning changes there, not the path
        return replace(Section.line(begin, after.start.translation - begin.translation, turn), ball=ball)
    inwards = after.tangent - before.tangent * (before.tangent @ after.tangent)
    centre = begin.translation + inwards / np.linalg.norm(inwards) * reach / np.tan(angle / 2.0)
    return replace(Section.arc(begin, centre, axis / sine, angle, turn), ball=ball)
