"""A reproduction while it is made: what is found so far, told and handed on after each step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import pandas as pd

from ocp_traj.progress import Progress
from ocp_traj.reproductions.comparison import Erratum, Reproduction, Run, Sheet
from ocp_traj.reproductions.gallery import Listed, gallery

if TYPE_CHECKING:
    from ocp_traj.reproductions.gallery import Draw

Keep = Callable[[Reproduction], None]
"""Given what has been found so far, after each step and at the end."""


def ignore(found: Reproduction) -> None:
    """Keeps nothing."""


class Draft:
    """What a reproduction has found so far.

    Args:
        problem: its id.
        reference: of the paper.
        total: steps that it takes.
        progress: told at the beginning of each.
        keep: given what there is at the end of each.
        listed: figures of the paper.
        misprints: see ``Sheet``.

    Attributes:
        sheet, runs, extra: as of ``Reproduction``.
    """

    def __init__(
        self, problem: str, reference: str, total: int, progress: Progress, keep: Keep, listed: Sequence[Listed],
        misprints: Mapping[tuple[str, str], tuple[str, str]] | None = None,
    ) -> None:  # fmt: skip
        self.sheet, self.runs = Sheet(misprints or {}), list[Run]()
        self.extra: dict[str, pd.DataFrame] = {}
        self._problem, self._reference, self._listed = problem, reference, listed
        self._total, self._done, self._progress, self._keep = total, 0, progress, keep
        self._drawn: dict[str, tuple[Draw, str]] = {}
        self._missing: dict[str, str] = {}
        self._kept = (0, 0, 0, 0)

    def begin(self, words: str) -> None:
        """Begins the next step; what is new since the last one is handed on."""
        state = len(self.sheet.comparisons), len(self.runs), len(self.extra), len(self._drawn)
        if state != self._kept:
            self._keep(replace(self._so_far(()), finished=False))
            self._kept = state
        self._progress(self._done, self._total, words)
        self._done += 1

    def within(self, words: str) -> Progress:
        """For what runs within a step: tells how far it is, in words, beside the steps done."""

        def told(done: int, total: int, more: str) -> None:
            share = f"{done} of {total}" if total else f"{done}"
            self._progress(self._done - 1, self._total, f"{words}: {share}{f', {more}' if more else ''}")

        return told

    def figure(self, number: str, draw: Draw, made_of: str = "") -> None:
        """A figure that can be drawn from now on; ``made_of`` where the list does not say what of."""
        self._drawn[number] = draw, made_of

    def no_figure(self, number: str, why: str) -> None:
        """A figure that this run cannot make."""
        self._missing[number] = why

    def finish(self, errata: Sequence[Erratum]) -> Reproduction:
        """All of it; the errata that comparisons confirmed come first."""
        found = self._so_far((*self.sheet.errata, *errata))
        self._progress(self._total, self._total, "done")
        return found

    def _so_far(self, errata: tuple[Erratum, ...]) -> Reproduction:
        figures = gallery(self._listed, self._drawn, self._missing)
        return Reproduction(
            self._problem, self._reference, tuple(self.sheet.comparisons), errata, tuple(self.runs), dict(self.extra),
            figures,
        )  # fmt: skip
