"""CasADi's ``nlpsol`` for an ``NLP``: in numbers, which costs nothing to build, or in symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi
import numpy as np

from ocp_traj.transcription.nlp import NLP
from ocp_traj.transcription.program import Program


class _Evaluation(casadi.Callback):
    """A function of an NLP's numbers as CasADi's ``nlpsol`` takes it.

    Args:
        name: of the function, as CasADi knows it.
        inputs, outputs: (name, sparsity) each.
        evaluate: arrays -> one array an output.
    """

    def __init__(
        self, name: str, inputs: Sequence[tuple[str, Any]], outputs: Sequence[tuple[str, Any]],
        evaluate: Callable[..., Sequence[Any]],
    ) -> None:  # fmt: skip
        casadi.Callback.__init__(self)
        self._inputs, self._outputs, self._evaluate = inputs, outputs, evaluate
        self.failure: BaseException | None = None
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_name_in(self, i: int) -> str:
        return self._inputs[i][0]

    def get_name_out(self, i: int) -> str:
        return self._outputs[i][0]

    def get_sparsity_in(self, i: int) -> Any:
        return self._inputs[i][1]

    def get_sparsity_out(self, i: int) -> Any:
        return self._outputs[i][1]

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, given: Sequence[Any], wanted: Sequence[Any]) -> int:
        """Evaluates on CasADi's own memory; a step that leads to no number is IPOPT's to shorten."""
        try:
            arguments = [np.frombuffer(a) if a is not None and len(a) else np.zeros(0) for a in given]
            with np.errstate(all="ignore"):
                found = self._evaluate(*arguments)
            for memory, values in zip(wanted, found, strict=True):
                if memory is not None and len(memory):
                    np.frombuffer(memory)[:] = values
        except Exception as failure:  # CasADi would take it for a point without values
            self.failure = failure
            return 1
        return 0


def _evaluations(program: Program) -> tuple[_Evaluation, ...]:
    """F and g, grad f, dg/dx and the Hessian of the Lagrangian, as ``nlpsol`` asks for them."""
    dense = casadi.Sparsity.dense
    n, m = program.size, program.rows
    x = [("x", dense(n, 1)), ("p", dense(0, 1))]
    multipliers = [("lam_f", dense(1, 1)), ("lam_g", dense(m, 1))]
    f, g = ("f", dense(1, 1)), ("g", dense(m, 1))
    return (
        _Evaluation("nlp", x, [f, g], lambda x, p: program.values(x)),
        _Evaluation(
            "nlp_grad_f", x, [f, ("grad_f_x", dense(n, 1))], lambda x, p: (program.values(x)[0], program.gradient(x))
        ),
        _Evaluation(
            "nlp_jac_g", x, [g, ("jac_g_x", program.jacobian_sparsity)],
            lambda x, p: (program.values(x)[1], program.jacobian(x)),
        ),
        _Evaluation(
            "nlp_hess_l", [*x, *multipliers], [("triu_hess_gamma_x_x", program.hessian_sparsity)],
            lambda x, p, factor, weights: (program.hessian(x, float(factor[0]), weights),),
        ),
    )  # fmt: skip


def numeric_solver(nlp: NLP, plugin: str, options: Mapping[str, Any]) -> tuple[Any, Sequence[_Evaluation]]:
    """One of CasADi's solvers on the NLP's own functions, and these, kept with the NLP: they must outlive a solve."""
    known, solver, evaluations = nlp.memory.get(plugin, (None, None, ()))
    if known != options:
        evaluations = _evaluations(nlp.program)
        values, gradient, jacobian, hessian = evaluations
        derivatives: dict[str, Any] = {"grad_f": gradient, "jac_g": jacobian, "hess_lag": hessian, "no_nlp_grad": True}
        solver = casadi.nlpsol("solver", plugin, values, {**options, **derivatives})
        nlp.memory[plugin] = dict(options), solver, evaluations
    return solver, evaluations


def raise_failures(evaluations: Sequence[_Evaluation]) -> None:
    """Raises what went wrong in a function, which CasADi takes for a point without values."""
    for evaluation in evaluations:
        if evaluation.failure is not None:
            raise evaluation.failure


def symbolic_solver(nlp: NLP, plugin: str, options: Mapping[str, Any]) -> Any:
    """One of CasADi's solvers on the NLP's expressions, kept with the NLP."""
    known, solver = nlp.memory.get(plugin, (None, None))
    if known != options:
        program: Any = {"x": nlp.x, "f": nlp.f, "g": nlp.g}
        solver = casadi.nlpsol("solver", plugin, program, dict(options))
        nlp.memory[plugin] = dict(options), solver
    return solver
