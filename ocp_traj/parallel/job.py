"""A job: an importable function of a problem and plain arguments, and the key by which its answer is found again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.metadata import version
from typing import Any

import numpy as np

from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.registry import known
from ocp_traj.parallel.recipe import Recipe
from ocp_traj.progress import silent
from ocp_traj.results.records import KEY
from ocp_traj.version import __version__

Answer = Mapping[str, Any]
"""What a job comes to, plain JSON values: a record."""

PACKAGES = "casadi", "numpy", "pin", "scipy"  # whose versions an answer depends on
_UNSTABLE = ("seconds", "elapsed")  # of a record: not the same when it is found again


@dataclass(frozen=True, eq=False)
class Job:
    """A piece of work that depends on nothing but what is in it.

    Attributes:
        function: ``module:name`` of ``(problem, **arguments, **hints) -> Answer``.
        problem: its first argument.
        arguments: numbers, texts, arrays, records, frozen values of importable classes.
        hints: further arguments, which may save work and change nothing of what can be made of the answer.
    """

    function: str
    problem: Problem
    arguments: Mapping[str, Any]
    hints: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def key(self) -> str:
        """SHA-256 of all that the answer depends on; empty where nobody else can know that."""
        if not known(self.problem.id):
            return ""
        versions = [__version__, *map(version, PACKAGES)]
        try:
            said = [versions, self.function, canonical(Recipe.of(self.problem)), canonical(self.arguments)]
        except Unnamed:
            return ""
        return sha256(json.dumps(said).encode()).hexdigest()

    def do(self) -> Answer:
        """The answer, found in this process."""
        return call(self.function, self.problem, self.arguments, self.hints)

    @property
    def words(self) -> str:
        """What it is, for messages."""
        what = self.arguments.get("scalarisation")
        return f"{self.function.partition(':')[2]} of {self.problem.id}" + ("" if what is None else f", {what}")


class Unnamed(Exception):
    """A value has no content that could be told from another's, such as a function without a name."""


def call(function: str, problem: Problem, arguments: Mapping[str, Any], hints: Mapping[str, Any]) -> Answer:
    """What a function given by its name makes of a problem."""
    module, _, name = function.partition(":")
    found: Callable[..., Answer] = getattr(import_module(module), name)
    return found(problem, **arguments, **hints)


def canonical(value: Any) -> Any:
    """JSON values that are the same for the same content, floats to the last bit; a record with a key is its key."""
    if value is None or isinstance(value, bool | int | str | float):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        if value.get(KEY):
            return {KEY: value[KEY]}
        return [[canonical(name), canonical(item)] for name, item in value.items() if name not in _UNSTABLE]
    if isinstance(value, list | tuple):
        return [canonical(item) for item in value]
    if isinstance(value, Enum):
        return value.name
    if is_dataclass(value) and not isinstance(value, type):
        own = {f.name: getattr(value, f.name) for f in fields(value)}
        if "<locals>" in type(value).__qualname__:
            raise Unnamed
        kept = {name: item for name, item in own.items() if item is not silent}
        return [f"{type(value).__module__}:{type(value).__qualname__}", canonical(kept)]
    raise Unnamed
