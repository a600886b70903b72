"""What long work says while it runs: a function that is told how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""(done, total, words): ``total`` is 0 where it is not known."""


def silent(done: int, total: int, words: str) -> None:
    """Says nothing."""
