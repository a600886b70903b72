"""Standard streams of the command line: those that are closed, or cannot spell a name."""

from __future__ import annotations

import os
import sys
from typing import TextIO

STDIN, STDOUT, STDERR = 0, 1, 2


def repair() -> None:
    """Opens what is closed, so that no file of the user's gets its number, and spells out what cannot be encoded.

    A closed stdout then refuses what is written to it, as a full one does; a closed stderr swallows it.
    """
    for number, flags in ((STDIN, os.O_WRONLY), (STDOUT, os.O_RDONLY), (STDERR, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, flags)  # gets the lowest number that is free: this one
    sys.stdout, sys.stderr = _stream(sys.stdout, STDOUT), _stream(sys.stderr, STDERR)


def _stream(stream: TextIO | None, number: int) -> TextIO:
    """``None`` is what Python makes of a stream that was closed when it started."""
    opened = stream or open(number, "w", encoding="utf-8", closefd=False)
    if hasattr(opened, "reconfigure"):
        opened.reconfigure(errors="backslashreplace")
    return opened
