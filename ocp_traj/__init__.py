"""Robot trajectory optimisation whose every trajectory is optimal and provably legal."""

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ocp_traj.version import __version__ as __version__

if TYPE_CHECKING:  # the same names for type checkers, which run no ``__getattr__``
    from ocp_traj import curves as curves
    from ocp_traj import problems as problems
    from ocp_traj import solvers as solvers
    from ocp_traj.api.fronts import certify_front as certify_front
    from ocp_traj.api.fronts import pareto as pareto
    from ocp_traj.api.payloads import payload as payload
    from ocp_traj.api.solving import solve as solve
    from ocp_traj.curves.bernstein import PiecewiseBezier as PiecewiseBezier
    from ocp_traj.formulation import standard as standard
    from ocp_traj.formulation.about import About as About
    from ocp_traj.formulation.additions import RobotState as RobotState
    from ocp_traj.formulation.additions import with_id as with_id
    from ocp_traj.formulation.additions import with_limit as with_limit
    from ocp_traj.formulation.additions import with_objective as with_objective
    from ocp_traj.formulation.objective import Objective as Objective
    from ocp_traj.formulation.problem import Problem as Problem
    from ocp_traj.formulation.problem import Variable as Variable
    from ocp_traj.formulation.registry import register as register
    from ocp_traj.formulation.requirements import DurationConstraint as DurationConstraint
    from ocp_traj.formulation.requirements import PathConstraint as PathConstraint
    from ocp_traj.formulation.requirements import PointConstraint as PointConstraint
    from ocp_traj.formulation.requirements import Requirements as Requirements
    from ocp_traj.formulation.requirements import State as State
    from ocp_traj.formulation.task import Task as Task
    from ocp_traj.formulation.tuning import Tuning as Tuning
    from ocp_traj.io.export import export as export
    from ocp_traj.io.plot import plot_front as plot_front
    from ocp_traj.io.plot import plot_trajectory as plot_trajectory
    from ocp_traj.io.run_reader import load_run as load_run
    from ocp_traj.io.store import save_run as save_run
    from ocp_traj.proof.audit import audit as audit
    from ocp_traj.results.front import Front as Front
    from ocp_traj.results.front_comparison import compare_fronts as compare_fronts
    from ocp_traj.results.solution import Solution as Solution
    from ocp_traj.results.trajectory import Trajectory as Trajectory
    from ocp_traj.robot.joint_limits import JointLimits as JointLimits
    from ocp_traj.robot.robot import Robot as Robot

# In a checkout `problems/` and `solvers/` lie beside this package, not in it, and from the repository root this package
# hides an installed one: without these lines `import ocp_traj.problems` fails there after a plain install.
_checkout = Path(__file__).resolve().parent.parent
if (_checkout / "pyproject.toml").is_file() and (_checkout / "problems" / "__init__.py").is_file():
    __path__.append(str(_checkout))


# Public names, imported on first use: `import ocp_traj` stays quick, and costs no solver.
_PUBLIC = {
    "problems": "ocp_traj.problems",
    "solvers": "ocp_traj.solvers",
    "standard": "ocp_traj.formulation.standard",
    "with_id": "ocp_traj.formulation.additions:with_id",
    "with_limit": "ocp_traj.formulation.additions:with_limit",
    "with_objective": "ocp_traj.formulation.additions:with_objective",
    "RobotState": "ocp_traj.formulation.additions:RobotState",
    "Task": "ocp_traj.formulation.task:Task",
    "solve": "ocp_traj.api.solving:solve",
    "pareto": "ocp_traj.api.fronts:pareto",
    "certify_front": "ocp_traj.api.fronts:certify_front",
    "payload": "ocp_traj.api.payloads:payload",
    "compare_fronts": "ocp_traj.results.front_comparison:compare_fronts",
    "register": "ocp_traj.formulation.registry:register",
    "load_run": "ocp_traj.io.run_reader:load_run",
    "save_run": "ocp_traj.io.store:save_run",
    "export": "ocp_traj.io.export:export",
    "audit": "ocp_traj.proof.audit:audit",
    "plot_front": "ocp_traj.io.plot:plot_front",
    "plot_trajectory": "ocp_traj.io.plot:plot_trajectory",
    "Problem": "ocp_traj.formulation.problem:Problem",
    "Variable": "ocp_traj.formulation.problem:Variable",
    "About": "ocp_traj.formulation.about:About",
    "Tuning": "ocp_traj.formulation.tuning:Tuning",
    "Objective": "ocp_traj.formulation.objective:Objective",
    "Requirements": "ocp_traj.formulation.requirements:Requirements",
    "State": "ocp_traj.formulation.requirements:State",
    "PathConstraint": "ocp_traj.formulation.requirements:PathConstraint",
    "PointConstraint": "ocp_traj.formulation.requirements:PointConstraint",
    "DurationConstraint": "ocp_traj.formulation.requirements:DurationConstraint",
    "Robot": "ocp_traj.robot.robot:Robot",
    "JointLimits": "ocp_traj.robot.joint_limits:JointLimits",
    "PiecewiseBezier": "ocp_traj.curves.bernstein:PiecewiseBezier",
    "curves": "ocp_traj.curves.families",
    "Trajectory": "ocp_traj.results.trajectory:Trajectory",
    "Solution": "ocp_traj.results.solution:Solution",
    "Front": "ocp_traj.results.front:Front",
}


def __getattr__(name: str) -> Any:
    """Imports a public name."""
    if name not in _PUBLIC:
        raise AttributeError(f"module 'ocp_traj' has no attribute {name!r}; public names are {', '.join(_PUBLIC)}")
    module, _, attribute = _PUBLIC[name].partition(":")
    found = import_module(module)
    return getattr(found, attribute) if attribute else found


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
