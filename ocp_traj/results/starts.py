"""An earlier result as the start of a solve: of which level of the problem, and with which variables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.errors import MOST_NAMES, InputError, ProblemDefinitionError, quoted
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.scalarise import Scalarisation, value_of
from ocp_traj.results.provenance import disagreement, recovered_variables
from ocp_traj.results.trajectory import Trajectory
from ocp_traj.transcription.symbolic import evaluate_objectives, motion_of

Start = tuple[tuple[Problem, ...], Array]
"""The problems from the level of a start to the one that is asked for, and the variables at the first of them."""


def levels_to(problem: Problem) -> tuple[Problem, ...]:
    """The problems from the coarsest to the given one."""
    chain = [problem]
    while chain[0].levels is not None and chain[0].levels.coarser is not None:
        chain.insert(0, chain[0].levels.coarser())
    return tuple(chain)


def start_of(problem: Problem, motions: Sequence[Motion], scalarisation: Scalarisation, source: str) -> Start:
    """The start that the best of some motions makes which fit the problem: of what is minimised, the least.

    Args:
        problem: that is to be solved; a motion of one of its levels, coarser or finer, fits as well.
        motions: of its joints, in its order.
        scalarisation: by which they are compared.
        source: of the motions, for complaints.

    Raises:
        InputError: one line with the reason why none fits.
    """
    found: list[tuple[float, Start]] = []
    reason = "it holds no trajectory"
    for motion in motions:
        try:
            chain, x = _fitted(problem, motion)
        except InputError as error:
            reason = str(error)
            continue
        value, _ = value_of(chain[0], scalarisation, evaluate_objectives(chain[0], x))
        found.append((value if np.isfinite(value) else np.inf, (chain, x)))
    if not found:
        raise InputError(f"{source} is no start of {problem.id}: {reason}")
    return min(found, key=lambda pair: pair[0])[1]


def _fitted(problem: Problem, motion: Motion) -> Start:
    """The finest level that has the motion's pieces, else the coarsest that it fits cut, and its variables there."""
    wanted = problem.requirements.joints
    if motion.joints != wanted:
        raise InputError(
            f"its joints are {quoted(list(motion.joints), MOST_NAMES)}, those of the problem "
            f"{quoted(list(wanted), MOST_NAMES)}; give one of the same joints, in the same order"
        )
    chain = [*levels_to(problem)]
    asked = len(chain) - 1
    while (levels := chain[-1].levels) is not None and levels.finer is not None:
        chain.append(levels.finer())
    counts = [level.at_symbols[1].segments for level in chain]
    fits = [(i, x) for i, level in enumerate(chain) if (x := _variables(level, motion)) is not None]
    same = [(i, x) for i, x in fits if counts[i] == motion.curve.segments]
    if fits:
        i, x = same[-1] if same else fits[0]
        return (*chain[i:asked], problem) if i <= asked else (chain[i],), x
    these = " or ".join(dict.fromkeys(map(str, counts)))
    if motion.curve.segments in counts:
        raise InputError(f"it has {motion.curve.segments} segments, and is yet no motion of this problem")
    raise InputError(f"it has {motion.curve.segments} segments, and curves of this problem have {these}")


def _variables(problem: Problem, motion: Motion) -> Array | None:
    """The variables of a motion, within their bounds; None where it does not fit."""
    if problem.variables_of is not None:
        try:
            x = problem.variables_of(motion)
        except ProblemDefinitionError:
            return None
    else:
        usual = motion_of(problem, problem.guess(np.random.default_rng(0))).parameters
        x = _own_variables(problem, replace(motion, parameters=dict(usual) | dict(motion.parameters)))
        # Of another payload it may be, as of other limits: its curve alone has to agree.
        if disagreement(problem, replace(motion, parameters=motion_of(problem, x).parameters), x)[0] > 1.0:
            return None
    return np.clip(x, problem.lower, problem.upper) if np.isfinite(x).all() else None


def _own_variables(problem: Problem, motion: Motion) -> Array:
    """The variables that a trajectory brings along, else those that come closest to it."""
    given = motion.variables if isinstance(motion, Trajectory) else {}
    if {name: np.size(block) for name, block in given.items()} == {v.id: len(v.labels) for v in problem.variables}:
        return np.concatenate([np.ravel(given[v.id]) for v in problem.variables])
    return recovered_variables(problem, motion)
