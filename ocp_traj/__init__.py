"""Robot trajectory optimisation whose every trajectory is optimal and provably legal."""

from importlib import import_module
from pathlib import Path
from typing import Any

# In a checkout `problems/` and `solvers/` lie beside this package, not in it, and from the repository root this package
# hides an installed one: without these lines `import ocp_traj.problems` fails there after a plain install.
_checkout = Path(__file__).resolve().parent.parent
if (_checkout / "pyproject.toml").is_file() and (_checkout / "problems" / "__init__.py").is_file():
    __path__.append(str(_checkout))

__version__ = "0.1.0"

# Public names, imported on first use: `import ocp_traj` stays quick, and costs no solver.
_PUBLIC = {
    "problems": "ocp_traj.problems",
    "solvers": "ocp_traj.solvers",
    "solve": "ocp_traj.api:solve",
    "pareto": "ocp_traj.api:pareto",
    "payload": "ocp_traj.api:payload",
    "Trajectory": "ocp_traj.trajectory:Trajectory",
    "Front": "ocp_traj.front:Front",
    "Robot": "ocp_traj.robot:Robot",
    "Limits": "ocp_traj.limits:Limits",
    "Problem": "ocp_traj.problem:Problem",
    "Requirements": "ocp_traj.requirements:Requirements",
    "load_run": "ocp_traj.run_reader:load_run",
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
