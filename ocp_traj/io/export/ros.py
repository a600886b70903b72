"""ROS 2: ``trajectory_msgs/msg/JointTrajectory`` as YAML or JSON.

The joint trajectory controller of ros2_control plays positions alone as lines, with velocities as cubics, with
accelerations as quintics, and checks no limit. Positions are in rad and m (REP 103).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ocp_traj.arrays import Array
from ocp_traj.curves.interpolation import INTERPOLATIONS
from ocp_traj.errors import InputError
from ocp_traj.files import plain, write_text
from ocp_traj.formulation.case import choice
from ocp_traj.formulation.requirements import ORDERS, Requirements
from ocp_traj.formulation.standard import EFFORT
from ocp_traj.io.export.exported import Exported, Timed, about, comments
from ocp_traj.proof.values import values_at
from ocp_traj.results.playback import Playback
from ocp_traj.results.trajectory import Trajectory

SUFFIXES = (".yaml", ".yml", ".json")
FIELDS = ("positions", "velocities", "accelerations")
DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)  # ten times as fast, where PyYAML was built with it


@dataclass(frozen=True, kw_only=True)
class Ros(Timed):
    """A joint trajectory for ROS 2.

    Attributes:
        interpolation: what the controller is to do, which decides what a point gives: ``quintic`` q, v and a,
            ``cubic`` q and v, ``linear`` q alone.
        effort: whether each point has the efforts of the problem's limit on them [N or N m].
        frame: ``frame_id`` of the header.
    """

    interpolation: str = choice("quintic", tuple(INTERPOLATIONS))
    effort: bool = False
    frame: str = ""

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes the message."""
        suffix = target.suffix.lower()
        if suffix not in SUFFIXES:
            raise InputError(f"a ros trajectory is written as {', '.join(SUFFIXES)}; {target.name!r} ends otherwise")
        names = self.names(trajectory)
        found = self.played(trajectory, requirements, self.interpolation)
        columns: dict[str, Array] = dict(zip(FIELDS, found.states, strict=False))
        if self.effort:
            columns["effort"] = efforts(found, requirements)
        facts = about(found)
        message = {
            "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": self.frame},
            "joint_names": names,
            "points": [
                {**{name: rows[i].tolist() for name, rows in columns.items()}, "time_from_start": _stamp(int(tick))}
                for i, tick in enumerate(found.ticks)
            ],
        }
        if suffix == ".json":
            text = json.dumps({"about": plain(facts), **message}, indent=1)
        else:
            body = yaml.dump(message, Dumper=DUMPER, sort_keys=False, default_flow_style=None, width=1_000_000)
            text = "\n".join([*comments(facts), body.rstrip("\n")])
        path = write_text(target, text + "\n")
        return Exported(path, "ros", (path,), facts, found.verdict)


def _stamp(tick: int) -> dict[str, Any]:
    seconds, nanoseconds = divmod(tick, 10**9)
    return {"sec": seconds, "nanosec": nanoseconds}


def efforts(found: Playback, wanted: Requirements | None) -> Array:
    """The efforts at the points ``(N, dof)``, as the limit on them has them on the segment that begins there.

    So where the payload changes the point has the efforts with the next one, and between it and the point before it the
    limit holds with the payload of its own segment.

    Args:
        found: the points.
        wanted: requirements of the trajectory.
    """
    curve = found.played
    limit = next((one for one in wanted.path_constraints if one.id == EFFORT), None) if wanted is not None else None
    if limit is None or wanted is None or len(limit.labels) != curve.dof:
        raise InputError(
            "the trajectory's problem has no effort limit, one a joint, to take efforts from; leave them out"
        )
    segment = np.minimum(np.arange(curve.segments + 1), curve.segments - 1)
    u = np.r_[np.zeros(curve.segments), 1.0]
    states = np.concatenate(
        [np.stack([curve.at(int(k), place, m)[0] for k, place in zip(segment, u, strict=True)], 1)
         for m in range(len(ORDERS))]
    )  # fmt: skip
    source, begins = found.source
    places = source[segment], np.append(begins, 1.0)
    return values_at(wanted, limit, states, *places, wanted.parameters_of([found.trajectory])).T
