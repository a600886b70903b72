"""A problem as plain data, from which another process builds the same one, and finds that it is the same.

A problem is functions: what can be sent is the id and the case that it is built from, and which of its levels it is.
Whoever builds it anew compares a fingerprint: variables and their bounds, limits, and the objectives at a point, to the
last bit. So a problem that was changed in Python after it was built, and a machine whose arithmetic differs, are found.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from typing import Any

import numpy as np

from ocp_traj.errors import InputError
from ocp_traj.files import plain
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.registry import known, load
from ocp_traj.results.starts import levels_to
from ocp_traj.results.trajectory import case_fields
from ocp_traj.transcription.symbolic import evaluate_objectives, motion_of

KEPT = 8  # problems that a process keeps built: our choice, more than a run has levels and alternatives


@dataclass(frozen=True)
class Recipe:
    """How to build a problem.

    Attributes:
        id: of the problem.
        case: fields of its case that differ from their defaults, as JSON.
        level: how many coarser ones it has.
        fingerprint: of the problem that is to come of it.
    """

    id: str
    case: str
    level: int
    fingerprint: str

    @classmethod
    def of(cls, problem: Problem) -> Recipe:
        """Of a problem, found once; raises ``InputError`` where another process cannot build it."""
        if not known(problem.id):
            raise InputError(
                f"{problem.id} is a problem of this process alone, which workers and resume cannot build again; give "
                "it the id module:function of an importable function that makes it (ocp_traj.with_id)"
            )
        recipe: Recipe = problem.cached("recipe", lambda: _recipe(problem))
        return recipe

    def build(self) -> Problem:
        """The problem; raises ``InputError`` where what comes of the id and the case is another one."""
        return _built(self)


@lru_cache(KEPT)
def _built(recipe: Recipe) -> Problem:
    problem = load(recipe.id, **json.loads(recipe.case))
    chain = levels_to(problem)
    while len(chain) <= recipe.level and (levels := chain[-1].levels) is not None and levels.finer is not None:
        chain = (*chain, levels.finer())
    problem = chain[min(recipe.level, len(chain) - 1)]
    if _fingerprint(problem) != recipe.fingerprint:
        raise InputError(
            f"{recipe.id} built again of its case is not the problem that was given, to the last bit: it was changed "
            "in Python, or this is another version or another kind of processor; give a problem that is built by its "
            "id, and like machines"
        )
    return problem


def _recipe(problem: Problem) -> Recipe:
    chain = levels_to(problem)
    # The coarsest one's case is that of the problem which the levels were made for.
    case = json.dumps(plain(case_fields(chain[0])), sort_keys=True)
    return Recipe(problem.id, case, len(chain) - 1, _fingerprint(problem))


def _fingerprint(problem: Problem) -> str:
    # A start that is planned takes seconds, and follows from the case.
    planned = problem.tuning.descends
    x = np.clip(1.0, problem.lower, problem.upper) if planned else problem.guess(np.random.default_rng(0))
    x = np.asarray(x, dtype=float)
    motion = motion_of(problem, x)
    said: list[Any] = [
        problem.labels, problem.units, problem.lower.tolist(), problem.upper.tolist(), problem.default_objective,
        sorted(problem.reference_point.items()), repr(problem.tuning), x.tolist(),
        sorted(evaluate_objectives(problem, x).items()),
        motion.curve.durations.tolist(), [points.tolist() for points in motion.curve.control_points],
        [[o.id, o.sense, o.scale] for o in problem.objectives],
        [
            [limit.id, limit.labels, np.asarray(limit.lower).tolist(), np.asarray(limit.upper).tolist()]
            for limit in problem.requirements.path_constraints
        ],
        [limit.id for limit in problem.requirements.clearance_constraints],
    ]  # fmt: skip
    return sha256(json.dumps(said).encode()).hexdigest()
