"""Steps on registers, put together into few passes over many rows: alike and independent ones are one operation.

A value is an integer: a step by its index, a leaf (a constant, or a row of an input) by the complement of its own.
A register holds upper bounds of -x and of x, so that both round upward, and the ends of -x are those of x in turn.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ocp_traj.interval.intervals import upper_bounds

Array = NDArray[np.float64]
Run = Callable[..., None]  # of the result ``(2, rows, N)`` to write and copies of the operands, of the same shape

_ENTRIES = 2**21  # of the registers at most: our choice, as many as the caches hold


class Read(NamedTuple):
    """A value as it is read: itself or, of an interval, its negative."""

    value: int
    negated: bool = False

    def negative(self, negated: bool = True) -> Read:
        """The negative of what is read, if ``negated``."""
        return Read(self.value, self.negated ^ negated)


class Step(NamedTuple):
    """An operation of a kind on values that are known before it; ``run`` is the same for all of the kind."""

    kind: Hashable
    run: Run
    reads: tuple[Read, ...]


def groups_of(steps: Sequence[Step]) -> list[list[int]]:
    """Indices of the steps in an order of passes: always the kind, with all its ready steps, of the longest way to go.

    The order is a list schedule by critical paths; for tapes of rigid-body dynamics 2800 steps become 92 passes.
    """
    needed = [{read.value for read in step.reads if read.value >= 0} for step in steps]
    users: list[list[int]] = [[] for _ in steps]
    way = [1] * len(steps)  # steps from here to the end of the longest chain
    for i in reversed(range(len(steps))):
        for j in needed[i]:
            users[j].append(i)
            way[j] = max(way[j], way[i] + 1)
    missing = [len(values) for values in needed]
    ready: dict[Hashable, list[int]] = defaultdict(list)
    for i, step in enumerate(steps):
        if not missing[i]:
            ready[step.kind].append(i)
    groups = []
    while ready:
        groups.append(ready.pop(max(ready, key=lambda kind: max(way[i] for i in ready[kind]))))
        for j in (j for i in groups[-1] for j in users[i]):
            missing[j] -= 1
            if not missing[j]:
                ready[steps[j].kind].append(j)
    return groups


class Program:
    """Passes over registers ``(2, rows, N)``.

    Args:
        leaves: constants, and inputs with their row.
        steps: each after those it reads.
        results: output and row of each, and what it is.
    """

    def __init__(
        self, leaves: Sequence[float | tuple[int, int]], steps: Sequence[Step], results: Sequence[tuple[int, int, Read]]
    ) -> None:
        """Orders the steps; see the class."""
        groups = groups_of(steps)
        order = [~j for j in range(len(leaves))] + [i for group in groups for i in group]
        self._rows, row = len(order), {value: k for k, value in enumerate(order)}

        def ends_of(reads: Sequence[Read]) -> NDArray[np.intp]:
            """Where both ends are among those of all registers ``(2, reads)``."""
            return np.array([[row[v] + self._rows * (end ^ negated) for v, negated in reads] for end in (0, 1)])

        self._constants = [j for j, leaf in enumerate(leaves) if isinstance(leaf, float)]
        numbers = np.array([leaves[j] for j in self._constants]).reshape(-1, 1)
        self._numbers = upper_bounds(numbers, numbers)
        self._inputs: dict[int, tuple[list[int], list[int]]] = defaultdict(lambda: ([], []))  # registers, their rows
        for j, leaf in enumerate(leaves):
            if not isinstance(leaf, float):
                self._inputs[leaf[0]][0].append(j)
                self._inputs[leaf[0]][1].append(leaf[1])
        self._passes: list[tuple[Run, slice, list[NDArray[np.intp]]]] = []
        end = len(leaves)
        for group in groups:
            begin, end = end, end + len(group)
            operands = zip(*(steps[i].reads for i in group), strict=True)
            self._passes.append((steps[group[0]].run, slice(begin, end), [ends_of(reads) for reads in operands]))
        self._results = [
            (k, [r for output, r, _ in results if output == k], ends_of([read for o, _, read in results if o == k]))
            for k in sorted({output for output, _, _ in results})
        ]

    def run(self, inputs: Sequence[Array], results: Sequence[Array]) -> None:
        """Writes results ``(2, numel, N)`` from inputs ``(2, numel, N or 1)``, upper bounds of both."""
        n_columns = results[0].shape[-1] if results else 0
        width = max(_ENTRIES // (2 * self._rows + 1), 1)
        memory = np.empty(2 * self._rows * min(width, n_columns))
        for columns in (slice(k, min(k + width, n_columns)) for k in range(0, n_columns, width)):
            flat = memory[: 2 * self._rows * (columns.stop - columns.start)].reshape(2 * self._rows, -1)
            registers = flat.reshape(2, self._rows, -1)
            registers[:, self._constants] = self._numbers
            for k, (leaves, rows) in self._inputs.items():
                registers[:, leaves] = (inputs[k] if inputs[k].shape[-1] == 1 else inputs[k][..., columns])[:, rows]
            for run, written, operands in self._passes:
                run(registers[:, written], *(flat.take(index, axis=0) for index in operands))
            for k, rows, index in self._results:
                results[k][:, rows, columns] = flat.take(index, axis=0)
