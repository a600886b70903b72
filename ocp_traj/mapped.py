"""Compiled functions evaluated at many instants in one call, on NumPy arrays and without copies by CasADi."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ocp_traj.arrays import Array

KEPT = 32  # sizes for which a mapped function is kept: our choice, more than an exchange's rounds have of a limit


class Mapped:
    """A casadi Function with dense inputs and outputs, mapped over instants.

    Args:
        function: each input and output a column ``(size,)``.
    """

    def __init__(self, function: Any) -> None:
        self._function = function
        self._sizes_in = [int(function.numel_in(i)) for i in range(function.n_in())]
        self._sizes_out = [int(function.numel_out(i)) for i in range(function.n_out())]
        self._kept: dict[int, tuple[Any, Any, list[Array], list[Array]]] = {}

    def __call__(self, *arguments: Array) -> Sequence[Array]:
        """Outputs ``(N, size)`` each, for inputs that broadcast to ``(N, size)``; overwritten by the next call."""
        count = len(arguments[0])
        if not count:  # CasADi maps over one instant or more
            return [np.zeros((0, size)) for size in self._sizes_out]
        if count not in self._kept:
            while len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
            # Column by column in CasADi is row by row in NumPy.
            given = [np.zeros((count, size)) for size in self._sizes_in]
            found = [np.zeros((count, size)) for size in self._sizes_out]
            buffer, evaluate = (self._function if count == 1 else self._function.map(count)).buffer()
            for i, array in enumerate(given):
                buffer.set_arg(i, array.reshape(-1).data)
            for i, array in enumerate(found):
                buffer.set_res(i, array.reshape(-1).data)
            self._kept[count] = buffer, evaluate, given, found
        _, evaluate, given, found = self._kept[count]
        for array, argument in zip(given, arguments, strict=True):
            array[:] = argument
        evaluate()
        return found
