"""The published problems, one file a paper, loaded by id: ``load("hybrid-spline", payload=8.0)``.

``module(id)`` is the file of a problem; ``case_class(id)`` is its ``Case``. Every paper's module here has

- ``Case``: the frozen dataclass of its numbers; metadata of its fields say what each may be;
- ``build(case)``: the problem of a case;
- ``robot(case)``: the robot that moves;
- ``forward_kinematics(q, case)``: poses of the tool, rotation ``(N, 3, 3)`` and position ``(N, 3)`` [m], of joint
  coordinates ``(N, dof)`` [m or rad];
- ``inverse_kinematics(rotation, position, case)``: joint coordinates ``(N, branches, dof)`` of such poses, NaN where a
  branch does not exist; whether the joints' ranges allow it is not looked at;
- ``via_points(case)``: joint coordinates ``(points, dof)`` that the curve passes through in this order whatever its
  variables are, NaN where a joint is free there;
- ``TABLE_n``: a table of the paper as a pandas table whose labels have the units in brackets, corrected where it is
  misprinted, or a dictionary by objective, in the objectives' units. What only the comparison with a paper reads is
  in ``ocp_traj.reproductions``, as printed.

``case`` may be left out everywhere: the default one is meant.
"""

from ocp_traj.formulation.registry import case_class, known, load, module, names, register, summary

__all__ = ["case_class", "known", "load", "module", "names", "register", "summary"]
