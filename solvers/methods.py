"""Methods by name, imported when they are used, and what text may say of their options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from typing import TYPE_CHECKING, Any

from ocp_traj.errors import InputError, nearest, quoted
from ocp_traj.formulation.case import convert

if TYPE_CHECKING:
    from ocp_traj.parallel.workers import Workers

MOST = 100_000  # of anything that is counted: our choice, what a machine's memory holds
NO_OPTIONS = ("seed", "points", "prove")  # the command line has flags for two, and proves what it shows

# Classes of methods that solve, and of those that find fronts.
SOLVE = {
    "exchange": "ocp_traj.solvers.exchange:Exchange",
    "pso": "ocp_traj.solvers.pso:PSO",
    "ga": "ocp_traj.solvers.ga:GA",
}
FRONT = {
    "trace": "ocp_traj.solvers.front_tracer:FrontTracer",
    "nsga2": "ocp_traj.solvers.nsga2:NSGA2",
    "mopso": "ocp_traj.solvers.mopso:MOPSO",
    "hmoga": "ocp_traj.solvers.hmoga:HMOGA",
    "memetic": "ocp_traj.solvers.memetic:Memetic",
}


def method_class(table: Mapping[str, str], method: str) -> type[Any]:
    """The class of a method, imported."""
    if method not in table:
        raise InputError(f"there is no method {quoted(method)}; methods are {', '.join(table)}")
    module, _, name = table[method].partition(":")
    found: type[Any] = getattr(import_module(module), name)
    return found


def configured(table: Mapping[str, str], method: str, **options: Any) -> Any:
    """A method's object; options it does not have are refused."""
    cls = method_class(table, method)
    known = [f.name for f in fields(cls)]
    for name in options:
        if name not in known:
            raise InputError(
                f"{method} has no option {quoted(name)}{nearest(name, known)}; options are {', '.join(known)}"
            )
    return cls(**options)


def workers_option(table: Mapping[str, str], method: str, workers: Workers) -> dict[str, Workers]:
    """Workers as an option of a method that has work for them; refused where there are some and it has none."""
    if "workers" in {f.name for f in fields(method_class(table, method))}:
        return {"workers": workers}
    if workers.count:
        raise InputError(f"{method} does all of its work in one process; leave workers out, or take another method")
    return {}


def options_from_text(table: Mapping[str, str], method: str, texts: Mapping[str, str]) -> dict[str, Any]:
    """Options as text, as values of their types: of those fields of the method's class that text can say.

    They are the fields that say what they may be, with ``formulation.case``, and those that are true or false.
    """
    cls = method_class(table, method)
    known = [f.name for f in fields(cls) if (f.metadata or isinstance(f.default, bool)) and f.name not in NO_OPTIONS]
    found = convert(method, cls, dict(texts), "option", known)
    for name, value in found.items():
        if isinstance(value, int) and value > MOST:
            raise InputError(f"{method}: {name} is {value}; give at most {MOST}")
    return found
