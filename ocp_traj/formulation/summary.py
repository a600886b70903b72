"""What a list says of a problem; a module states it as ``SUMMARY`` where building its problem takes long."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from ocp_traj.formulation.problem import Problem


@dataclass(frozen=True)
class Summary:
    """What a list says of a problem.

    Attributes:
        id, title: of the problem.
        robot: its model's name, and its joints.
        curve: kind of it.
        variables: how many.
        objectives: their ids.
        paper: where it stands.
    """

    id: str
    title: str
    robot: str
    curve: str
    variables: int
    objectives: tuple[str, ...]
    paper: str

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Of a problem that is built."""
        joints = f"{problem.requirements.dof} joints"
        robot = f"{problem.robot.model.name}, {joints}" if problem.robot else joints
        objectives = tuple(objective.id for objective in problem.objectives)
        return cls(
            problem.id,
            problem.about.title,
            robot,
            problem.about.curve_kind,
            problem.size,
            objectives,
            problem.about.reference,
        )
