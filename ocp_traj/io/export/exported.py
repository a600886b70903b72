"""What was exported, and what is proved of it: said in the file and on the screen."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation.case import Checked, number
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.proof.verdicts import PROVED, UNDECIDED
from ocp_traj.results.playback import TOLERANCE, Playback, at_knots, at_rate
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.version import __version__

KNOTS = "knots"


@dataclass(frozen=True)
class Exported(os.PathLike[str]):
    """The files that were written; as a path, the first of them.

    Attributes:
        path: the file that was asked for.
        format: its format.
        paths: all files, ``path`` first.
        about: what is said of it: duration [s], deviation, excess, verdict, ..; empty for tables.
        verdict: ``proved``, ``violated`` or ``undecided`` of the motion as it will be played; None where there is none
            to be played, as of tables.
    """

    path: Path
    format: str
    paths: tuple[Path, ...]
    about: Mapping[str, Any]
    verdict: str | None = None

    @property
    def proved(self) -> bool:
        """Whether what will be played is proved, or nothing is to be played."""
        return self.verdict in (PROVED, None)

    def __fspath__(self) -> str:
        return str(self.path)


class Format(Protocol):
    """A format, with its options as fields."""

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes a trajectory, whose limits may be unknown."""
        ...


@dataclass(frozen=True, kw_only=True)
class Timed(Checked):
    """Formats of points in time.

    Attributes:
        at: ``knots``, the ends of the curve's segments, unless there is a rate.
        rate: points a second [Hz].
        tolerance: by how much quintics between knots may leave the trajectory [rad or m].
        joints: other names for joints, by their own.
    """

    at: str | None = None
    rate: float | None = number(None, "Hz", above=0.0, most=1e9)
    tolerance: float = number(TOLERANCE, "rad or m", above=0.0)
    joints: Mapping[str, str] | None = None

    def __post_init__(self) -> None:
        """Checks the options."""
        super().__post_init__()
        if self.at not in (None, KNOTS):
            raise InputError(f"points are at {quoted(self.at)}; give {KNOTS}, or a rate")
        names = self.joints if isinstance(self.joints, Mapping) else {None: None} if self.joints is not None else {}
        if not all(isinstance(name, str) for pair in names.items() for name in pair):
            raise InputError(f"joints is {quoted(self.joints)}; give other names of joints by their own")

    def played(
        self, trajectory: Trajectory, requirements: Requirements | None, interpolation: str = "quintic"
    ) -> Playback:
        """The points, and what is between them."""
        if self.rate is None:
            return at_knots(trajectory, requirements, interpolation, self.tolerance)
        if self.at is not None:
            raise InputError("points are at knots or at a rate; give one of the two")
        return at_rate(trajectory, requirements, self.rate, interpolation)

    def names(self, trajectory: Trajectory) -> list[str]:
        """The joints' names in the file."""
        given = dict(self.joints or {})
        for name in given:
            if name not in trajectory.joints:
                known = nearest(name, trajectory.joints)
                raise InputError(
                    f"there is no joint {quoted(name)} to rename{known}; joints are {', '.join(trajectory.joints)}"
                )
        found = [given.get(joint, joint) for joint in trajectory.joints]
        if len(set(found)) < len(found):
            raise InputError(f"two joints would have one name: {', '.join(found)}; give different ones")
        return found


def about(playback: Playback, words: str | None = None) -> dict[str, Any]:
    """What is said of points and of what is played between them; ``words`` in place of the verdict's own."""
    source = playback.trajectory
    found: dict[str, Any] = {"written by": f"ocp-traj {__version__}"}
    if source.problem:
        found["problem"] = source.problem
    if source.parameters:
        found["parameters"] = {name: float(value) for name, value in source.parameters.items()}
    found |= {
        "points": len(playback.ticks),
        "interpolation": playback.interpolation,
        "duration [s]": playback.duration,
        "slowed by": playback.factor - 1.0,
        "deviation [rad or m]": playback.deviation,
    }
    if isfinite(playback.excess):
        found["excess [share of a limit]"] = playback.excess
    return {**found, "verdict": words or playback.explain()}


def comments(facts: Mapping[str, Any], mark: str = "#") -> list[str]:
    """Lines that say it; ``mark`` begins a comment."""
    return [f"{mark} {name}: {_text(value)}" for name, value in facts.items()]


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    return f"{value:.9g}" if isinstance(value, float) else str(value)


RETIMED = "nothing of the motion is proved: the controller times it anew"


def retimed(playback: Playback) -> dict[str, Any]:
    """What is said of points whose times the controller does not take."""
    facts = about(playback, RETIMED)
    return {name: facts[name] for name in ("written by", "problem", "points", "verdict") if name in facts}


def unproved(path: Path, format: str, paths: tuple[Path, ...], facts: Mapping[str, Any]) -> Exported:
    """An export of which nothing is proved, since the controller does with it what nobody here knows."""
    return Exported(path, format, paths, facts, UNDECIDED)
