"""URScript: a program that plays quintics between points, or samples at a rate, by ``servoj``."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.files import write_text
from ocp_traj.formulation.case import number
from ocp_traj.formulation.requirements import Requirements
from ocp_traj.io.export.exported import Exported, Timed, about, comments, unproved
from ocp_traj.io.export.tables import joint_units
from ocp_traj.results.playback import MOST_POINTS
from ocp_traj.results.trajectory import Trajectory

JOINTS = 6
SLOWEST = 1.0  # [Hz], of samples: our choice; between slower ones ``servoj`` would stand
NEAR = 0.01  # [rad] from the first point, within which the program starts: our choice
STOP = 2.0  # [rad/s2] of ``stopj`` at the end, where the robot rests already: our choice
SERVO = "proved are the quintics that the setpoints lie on; servoj follows them with its lookahead and gain"
SAMPLED = "the setpoints lie on the trajectory; nothing is proved of what servoj makes between them"

QUINTIC = """\
  # Plays the quintic from the last point to position q, velocity v and acceleration a, in T seconds.
  def ocp_quintic(q, v, a, T):
    local c3 = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    local c4 = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    local c5 = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    local i = 0
    while i < 6:
      local way = q[i] - ocp_q[i] - (ocp_v[i] + 0.5 * ocp_a[i] * T) * T
      local rate = (v[i] - ocp_v[i] - ocp_a[i] * T) * T
      local bend = (a[i] - ocp_a[i]) * T * T
      c3[i] = (10.0 * way - 4.0 * rate + 0.5 * bend) / pow(T, 3)
      c4[i] = (7.0 * rate - 15.0 * way - bend) / pow(T, 4)
      c5[i] = (6.0 * way - 3.0 * rate + 0.5 * bend) / pow(T, 5)
      i = i + 1
    end
    local t = ocp_late
    while t < T:
      local goal = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
      i = 0
      while i < 6:
        goal[i] = ocp_q[i] + t * (ocp_v[i] + t * (0.5 * ocp_a[i] + t * (c3[i] + t * (c4[i] + t * c5[i]))))
        i = i + 1
      end
      servoj(goal, t=get_steptime(), lookahead_time=LOOKAHEAD, gain=GAIN)
      t = t + get_steptime()
    end
    ocp_late = t - T
    ocp_q = q
    ocp_v = v
    ocp_a = a
  end
"""


@dataclass(frozen=True, kw_only=True)
class Urscript(Timed):
    """A program for a Universal Robots arm: quintics, computed at the controller's rate, or samples at ``rate``.

    Attributes:
        lookahead: of ``servoj`` [s], within what it takes.
        gain: of ``servoj``, likewise.
    """

    lookahead: float = number(0.03, "s", least=0.03, most=0.2)
    gain: float = number(2000.0, least=100.0, most=2000.0)

    def write(self, trajectory: Trajectory, requirements: Requirements | None, target: Path) -> Exported:
        """Writes the program; it ends at once where the arm is not at its first point."""
        self.names(trajectory)
        units = joint_units(trajectory) or ("rad",) * len(trajectory.joints)
        if len(trajectory.joints) != JOINTS or set(units) != {"rad"}:
            raise InputError(
                f"URScript moves {JOINTS} revolute joints; the trajectory has {len(trajectory.joints)}: "
                f"{', '.join(map(' '.join, zip(trajectory.joints, units, strict=True)))}"
            )
        if self.rate is not None:
            return self._samples(trajectory, self.rate, target)
        found = self.played(trajectory, requirements)
        facts = about(found) | {"servoj": SERVO}
        q, v, a = found.states
        body = [f"  global ocp_{name} = {_list(rows[0])}" for name, rows in zip("qva", found.states, strict=True)]
        body.append("  global ocp_late = 0.0")
        quintic = QUINTIC.replace("LOOKAHEAD", repr(self.lookahead)).replace("GAIN", repr(self.gain))
        body += [*quintic.rstrip("\n").split("\n"), *_start(q[0])]
        for k, ticks in enumerate(np.diff(found.ticks).tolist(), 1):
            seconds = f"{ticks // 10**9}.{ticks % 10**9:09d}"
            body.append(f"  ocp_quintic({_list(q[k])}, {_list(v[k])}, {_list(a[k])}, {seconds})")
        path = self._program(target, comments(facts), body, q[-1])
        return Exported(path, "urscript", (path,), facts, found.verdict)

    def _samples(self, trajectory: Trajectory, rate: float, target: Path) -> Exported:
        duration = trajectory.duration
        if not SLOWEST <= rate <= 500.0 or duration * rate > MOST_POINTS:
            raise InputError(
                f"servoj takes {SLOWEST:g} to 500 setpoints a second, {MOST_POINTS} in all; got {rate:g} Hz"
            )
        count = int(np.ceil(duration * rate - 1e-9)) + 1
        rows = trajectory.curve(np.minimum(np.arange(count) / rate, duration))
        facts = {
            "points": count,
            "rate [Hz]": rate,
            "duration [s]": (count - 1) / rate,
            "verdict": f"not proved: {SAMPLED}",
        }
        call = f"t={1.0 / rate!r}, lookahead_time={self.lookahead!r}, gain={self.gain!r})"
        body = [*_start(rows[0]), *(f"  servoj({_list(row)}, {call}" for row in rows)]
        path = self._program(target, comments(facts), body, rows[-1])
        return unproved(path, "urscript", (path,), facts)

    def _program(self, target: Path, header: list[str], body: list[str], end: Array) -> Path:
        name = re.sub(r"\W", "_", target.name.split(".")[0]) or "motion"
        call = f"t=get_steptime(), lookahead_time={self.lookahead!r}, gain={self.gain!r})"
        last = [f"  servoj({_list(end)}, {call}", f"  stopj({STOP!r})", "end"]
        lines = [*header, f"def play_{name}():", *body, *last, f"play_{name}()"]
        return write_text(target, "\n".join(lines) + "\n")


def _list(row: Array) -> str:
    return f"[{', '.join(repr(float(value)) for value in row)}]"


def _start(first: Array) -> list[str]:
    """Lines that end the program where the arm is elsewhere."""
    return [
        f"  local first = {_list(first)}",
        "  local now = get_actual_joint_positions()",
        "  local j = 0",
        "  while j < 6:",
        f"    if norm(now[j] - first[j]) > {NEAR!r}:",
        '      popup("the arm is not at the first point of the motion", title="ocp-traj", error=True, blocking=True)',
        "      halt",
        "    end",
        "    j = j + 1",
        "  end",
    ]
