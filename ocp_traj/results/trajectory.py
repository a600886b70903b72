"""A trajectory: a motion with the problem, case and variables it came from: dilates, saves, loads."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import COLUMNS, Motion
from ocp_traj.display import Shown, count
from ocp_traj.errors import InputError, cut
from ocp_traj.files import write_text
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.registry import load
from ocp_traj.formulation.task import Task
from ocp_traj.paths.trajectory_file import FORMAT, curve_of, finite, joints_of, read_values, sound
from ocp_traj.proof.audit import audit_all
from ocp_traj.proof.verdicts import Audit
from ocp_traj.results.provenance import audit_motions, bound_rows
from ocp_traj.transcription.symbolic import motion_of

REMEMBERED = 2048  # audits a problem keeps: our choice, more than the points of a front


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Shown, Motion):
    """A motion with the problem, case and variables it came from.

    Attributes:
        problem: id of the problem it solves, empty for one from elsewhere.
        case: the problem's case fields that differ from its defaults.
        variables: decision variables by block.
        origin: the problem itself, where it is at hand; a file has its id and case only.
    """

    problem: str = ""
    case: Mapping[str, Any] = field(default_factory=dict)
    variables: Mapping[str, Array] = field(default_factory=dict)
    origin: Problem | None = None

    def dilate(self, factor: float) -> Trajectory:
        """The same path ``factor`` times slower; it forgets the variables, which no longer describe it."""
        if not (np.isfinite(factor) and factor > 0.0):
            raise InputError(f"a trajectory is dilated by a positive number; got {factor}")
        return replace(self, curve=self.curve.dilate(factor), variables={})

    def audit(self, **options: Any) -> Audit:
        """Checks every limit of its problem at every instant; see ``ocp_traj.results.provenance.audit_motions``."""
        if self.origin is None and not self.problem:
            raise InputError(
                "this trajectory names no problem; give its limits: --limits FILE, or ocp_traj.audit(trajectory, "
                "requirements)"
            )
        return audit_motions(self.posed, [self], [self.variables], **options)[0]

    @cached_property
    def posed(self) -> Problem:
        """The problem that it solves, built from its case where it is not at hand."""
        return load(self.problem, **self.case) if self.origin is None else self.origin

    def _headline(self) -> str:
        return f"Trajectory{' of ' if self.problem else ''}{self.problem}: {self.duration:.6g} s"

    def _facts(self) -> dict[str, str]:
        highest = max(len(points) for points in self.curve.control_points) - 1
        return {
            "curve": f"{count(self.curve.segments, 'segment')}, up to degree {highest}",
            "joints": ", ".join(self.joints),
            "parameters": ", ".join(f"{name} {value:g}" for name, value in self.parameters.items()),
            "case": ", ".join(f"{name} {value}" for name, value in self.case.items()),
        }

    def _tables(self) -> list[pd.DataFrame]:
        """Exact extrema of each joint's derivatives up to jerk [SI]."""
        extrema = {name: self.curve.extrema(order) for order, name in enumerate(COLUMNS[:4])}
        columns = {
            (name, end): [getattr(one, field) for one in found]
            for name, found in extrema.items()
            for end, field in (("least", "lower"), ("largest", "upper"))
        }
        return [pd.DataFrame(columns, index=pd.Index(self.joints, name="joint"))]

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON values."""
        return {
            "format": FORMAT,
            "problem": self.problem,
            "case": dict(self.case),
            "variables": {name: np.asarray(block).tolist() for name, block in self.variables.items()},
            "parameters": {name: float(value) for name, value in self.parameters.items()},
            "joints": list(self.joints),
            "durations": self.curve.durations.tolist(),
            "control_points": [points.tolist() for points in self.curve.control_points],
        }

    def save(self, path: str | Path) -> Path:
        """Writes the trajectory as JSON, whole or not at all."""
        return write_text(path, json.dumps(self.to_dict(), indent=1) + "\n")

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Reads a trajectory of this package, or one from elsewhere, as JSON, YAML (ROS) or CSV (a table); see docs."""
        return cls.from_dict(read_values(path), str(path))

    @classmethod
    def from_dict(cls, data: Any, source: str = "trajectory") -> Trajectory:
        """From plain JSON values, in one of these formats.

        ``ocp-traj/trajectory/1``: ``joints``, ``durations [s] (K,)``, ``control_points`` per segment ``(n + 1, dof)``.
        ``ocp-traj/samples/1``: ``joints``, ``times [s] (N,)`` increasing, ``positions (N, dof)``: a C2 cubic spline is
        put through the points, at rest at both ends if ``"rest": true``, else not-a-knot; the audit is of that spline.
        With ``velocities`` there are cubics between the points, with ``accelerations`` too quintics.
        ``ocp-traj/spline/1``: ``joints``, ``knots [s] (K + 1,)``, ``coefficients`` per segment ``(n + 1, dof)``,
        of ascending powers of the time since the segment's start.
        ``ocp-traj/bpoly/1``: ``joints``, ``x [s] (K + 1,)``, ``c (n + 1, K, dof)`` as scipy's ``BPoly`` has them.
        ``JointTrajectory`` of ROS 2, known by ``joint_names`` and ``points``: as samples.
        """
        curve = curve_of(data, source)
        with sound(data, source):
            return cls(
                curve,
                joints_of(data),
                {k: float(finite(v, f"the parameter {cut(k)}", 0)) for k, v in data.get("parameters", {}).items()},
                str(data.get("problem", "")),
                dict(data.get("case", {})),
                {k: np.atleast_1d(np.asarray(v, dtype=float)) for k, v in data.get("variables", {}).items()},
            )


def trajectory_of(problem: Problem, x: ArrayLike) -> Trajectory:
    """The trajectory that a decision vector stands for."""
    motion = motion_of(problem, x)
    return Trajectory(
        motion.curve, motion.joints, motion.parameters, problem.id, case_fields(problem), problem.unpack(x), problem
    )


def audit_points(problem: Problem, xs: Sequence[Array], **options: Any) -> list[tuple[Trajectory, Audit]]:
    """The trajectories that decision vectors stand for, each with its audit, the bounds on its variables among it.

    All are proved together. A proof is for good: what the problem has seen lately is not proved again.
    """
    vectors = [np.array(x, dtype=float) for x in xs]
    if options:
        return _audited(problem, vectors, options)
    known: dict[bytes, tuple[Trajectory, Audit]] = problem.cached("audits", dict)
    new = {x.tobytes(): x for x in vectors if x.tobytes() not in known}
    found = dict(zip(new, _audited(problem, list(new.values()), {}), strict=True))
    answer = [found.get(x.tobytes()) or known[x.tobytes()] for x in vectors]
    known.update(found)
    for key in list(known)[: max(len(known) - REMEMBERED, 0)]:
        del known[key]
    return answer


def _audited(problem: Problem, xs: Sequence[Array], options: Mapping[str, Any]) -> list[tuple[Trajectory, Audit]]:
    moved = [trajectory_of(problem, x) for x in xs]
    audits = audit_all(moved, problem.requirements, **options)
    return [
        (motion, replace(found, rows=(*found.rows, *bound_rows(problem, x))))
        for x, motion, found in zip(xs, moved, audits, strict=True)
    ]


def case_fields(problem: Problem) -> dict[str, Any]:
    """The case's fields that differ from their defaults, as plain values: enough to build the problem again.

    A case that is no dataclass, or none at all, has no fields.
    """
    if isinstance(problem.case, Task):
        return problem.case.fields()
    if not is_dataclass(problem.case):
        return {}
    given = {f.name: (_plain(getattr(problem.case, f.name)), _plain(_default(f))) for f in fields(problem.case)}
    return {name: value for name, (value, default) in given.items() if value != default}


def _default(field: Field[Any]) -> Any:
    """A field's default; of one that has to be given, what equals nothing."""
    return field.default_factory() if field.default_factory is not MISSING else field.default


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(item) for item in value] if isinstance(value, tuple | list) else value
