"""How far a rule's sum is from the integral it stands for, at a motion: the rule beside finer ones."""

from __future__ import annotations

import numpy as np

from ocp_traj.arrays import Array
from ocp_traj.curves.motion import Motion
from ocp_traj.formulation.objective import GAUSS, Objective, Rule
from ocp_traj.formulation.problem import Problem
from ocp_traj.formulation.requirements import ORDERS
from ocp_traj.interval.tape import Tape
from ocp_traj.transcription.symbolic import constants_at, integrand_function

PARTS = (2, 4)  # in which ``GAUSS`` cuts a segment for the finer sums: our choice


def quadrature_errors(problem: Problem, motion: Motion) -> dict[str, float]:
    """Of each objective that is an integral, or a sum with some, the error of its rule along a motion [its unit].

    The difference to the finest sum, and that of the two finest: an estimate, no bound.
    """
    errors = {o.id: _error(problem, motion, o) for o in problem.objectives if o.integrand is not None}
    for objective in problem.objectives:
        own = {name: factor for name, factor in (objective.terms or {}).items() if name in errors}
        if own:
            errors[objective.id] = sum(abs(factor) * errors[name] for name, factor in own.items())
    return errors


def _error(problem: Problem, motion: Motion, objective: Objective) -> float:
    fine, finest = (_sum(problem, motion, objective, _cut(GAUSS, parts)) for parts in PARTS)
    return abs(_sum(problem, motion, objective, objective.quadrature) - finest) + abs(fine - finest)


def _cut(rule: Rule, parts: int) -> Rule:
    """A rule on each of equal parts of a segment."""
    return tuple(((i + u) / parts, w / parts) for i in range(parts) for u, w in rule)


def _sum(problem: Problem, motion: Motion, objective: Objective, rule: Rule) -> float:
    """The sum that a rule makes of an integrand."""
    tape: Tape = problem.cached(("integrand tape", objective.id), lambda: Tape(integrand_function(problem, objective)))
    nodes, weights = np.array(rule).T
    curve, dof, count = motion.curve, motion.curve.dof, motion.curve.segments
    states: Array = np.empty((len(ORDERS), dof, count, len(nodes)))
    for k in range(count):
        for order in range(len(ORDERS)):
            states[order, :, k] = curve.at(k, nodes, order).T
    segment = np.repeat(np.arange(count), len(nodes))
    values = tape.evaluate(
        states.reshape(len(ORDERS) * dof, -1), np.tile(nodes, count)[None],
        problem.requirements.parameters_of([motion]),
        constants_at(objective, segment).T if objective.constants is not None else np.zeros((0, 1)),
    )[0]  # fmt: skip
    each = np.broadcast_to(values.ravel(), count * len(nodes)).reshape(count, len(nodes)) @ weights
    return float(each @ np.asarray(curve.durations, dtype=float))
