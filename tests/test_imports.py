"""Arrows between modules: no circle, lazy imports and those for type checkers included, and none that runs up."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLACES = {"ocp_traj": "ocp_traj", "problems": "ocp_traj.problems", "solvers": "ocp_traj.solvers"}

# From the ground up: what stands in a line may lean on its own line and on those above it, and on nothing below.
LAYERS = (
    "version errors progress arrays stopping blas mapped rounding files display",
    "interval",  # a seam's error is enclosed as well, so it stands below the paths
    "curves",
    "robot",
    "paths",
    "formulation",
    "problems",
    "proof",
    "transcription",
    "results",
    "evolution",
    "parallel",
    "solvers",
    "io",
    "api",
    "reproductions report",
    "cli",
    "__main__ __init__",
)


def modules() -> dict[str, Path]:
    """Every module of the package, by its dotted name."""
    found = {}
    for folder, package in PLACES.items():
        for path in (ROOT / folder).rglob("*.py"):
            parts = path.relative_to(ROOT / folder).with_suffix("").parts
            found[".".join((package, *(part for part in parts if part != "__init__" or len(parts) == 1)))] = path
    return found


def arrows() -> dict[str, set[str]]:
    """Which modules each imports, wherever in it that stands; the public names of the package itself do not count."""
    known = modules()
    found: dict[str, set[str]] = {name: set() for name in known if name != "ocp_traj.__init__"}
    for name in found:
        for node in ast.walk(ast.parse(known[name].read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                found[name] |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)} & set(found)
            elif isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names} & set(found)
        found[name].discard(name)
    return found


def layer(name: str) -> int:
    """The place of a module among ``LAYERS``."""
    room = name.split(".")[1]
    (place,) = (i for i, line in enumerate(LAYERS) if room in line.split())
    return place


def test_no_circle() -> None:
    tuple(TopologicalSorter(arrows()).static_order())  # raises CycleError, which names the circle


def test_no_arrow_runs_up() -> None:
    up = [(a, b) for a, targets in arrows().items() for b in targets if layer(b) > layer(a)]
    assert up == []
