"""Ctrl-C and the end of a budget: noted while work runs, and obeyed where the work can stop with what it has.

An exception in the middle of anything would break off the writing of a file, be taken by CasADi for a failed solve, or
get lost in a callback. So who has something to return when it is stopped opens a ``stopping()`` block: inside, a signal
is only noted, and ``check()``, at a safe place, raises what ends the work: ``KeyboardInterrupt``, again and again until
the outermost block is left, or ``OutOfTime`` once the block's time is over.

Blocks of one thread share what they note. Signal handlers are replaced by the outermost block only, in the main thread
only, and only Python's own handler of Ctrl-C and those of the command line: a handler of the caller's is left alone. A
second signal is not noted but obeyed at once. This module is quick to import: the command line does so first of all.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
BY_SIGNAL = 128  # the exit code of a command that a signal ended, less the signal's number: the shells' convention
SHOW_CURSOR = b"\r\x1b[K\x1b[?25h"  # clears the line of a progress bar, and shows the cursor that it has hidden

Handler = Callable[[int, FrameType | None], Any]


class OutOfTime(Exception):
    """The time given to some work is over."""


STOPS = (KeyboardInterrupt, OutOfTime)


class Stopping:
    """What a thread has noted since its outermost block was opened.

    Attributes:
        interrupted: whether a signal came, or something inside raised ``KeyboardInterrupt``.
        told: whether the work knows of it, so that whoever opened the outermost block learns of it from a result.
        deadline: of the innermost block that has one, on ``time.perf_counter``.
        depth: of the nested blocks.
    """

    def __init__(self) -> None:
        self.interrupted, self.told = False, False
        self.deadline, self.depth = float("inf"), 0

    @property
    def due(self) -> bool:
        """Whether the work should end."""
        return self.interrupted or time.perf_counter() >= self.deadline

    def check(self) -> None:
        """Raises what ends the work, if it should end."""
        if self.interrupted:
            self.told = True
            raise KeyboardInterrupt
        if time.perf_counter() >= self.deadline:
            raise OutOfTime

    def take(self, reason: BaseException) -> None:
        """Notes what ended the work, one of ``STOPS``, whoever raised it."""
        if isinstance(reason, KeyboardInterrupt):
            self.interrupted = self.told = True

    def tell(self) -> bool:
        """Whether it was interrupted, for a result that says so."""
        self.told = self.told or self.interrupted
        return self.interrupted


_thread = threading.local()  # open: the Stopping of its blocks
_first = [int(signal.SIGINT)]  # the signal that was noted first, of this process


def current() -> Stopping:
    """What the open block of this thread has noted; outside of all blocks there is nothing to note."""
    block: Stopping | None = getattr(_thread, "open", None)
    return Stopping() if block is None else block


@contextmanager
def stopping(seconds: float = float("inf")) -> Iterator[Stopping]:
    """A block inside which signals are noted and ``check()`` raises; its own time is over after ``seconds``.

    A signal nobody was told of is delivered when the outermost block is left.
    """
    block: Stopping = getattr(_thread, "open", None) or Stopping()
    outer, before = block.deadline, dict[int, Handler]()
    block.depth += 1
    try:
        if block.depth == 1:
            _thread.open = block
            _note_signals(block, before)
        block.deadline = min(outer, time.perf_counter() + seconds)
        yield block
    except KeyboardInterrupt as reason:
        block.take(reason)
        raise
    finally:
        block.deadline = outer
        block.depth -= 1
        if block.depth == 0:
            _thread.open = None
            for number, handler in before.items():
                signal.signal(number, handler)
            if block.interrupted and not block.told:
                before[_first[0]](_first[0], None)


def _note_signals(block: Stopping, before: dict[int, Handler]) -> None:
    """Puts a handler that only notes in the place of those that raise or end the process, which go to ``before``."""
    if threading.current_thread() is not threading.main_thread():
        return

    def note(number: int, frame: FrameType | None) -> None:
        if block.interrupted:  # the second one
            before[number](number, frame)
        else:
            block.interrupted, _first[0] = True, number

    for number in SIGNALS:
        handler = signal.getsignal(number)
        if callable(handler) and handler in (signal.default_int_handler, end_at_once):
            before[number] = handler
            signal.signal(number, note)


def end_at_once(number: int, frame: FrameType | None) -> None:
    """Signal handler of the command line: ends the process with one line on stderr."""
    first = _first[0] if current().interrupted else number
    try:
        os.write(2, (SHOW_CURSOR if os.isatty(2) else b"") + b"interrupted\n")
    finally:
        os._exit(BY_SIGNAL + first)


def obey_signals() -> None:
    """From here on Ctrl-C, SIGTERM and SIGHUP end the process without a traceback, unless they are ignored (nohup)."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, end_at_once)


def ignore_signals() -> None:
    """The process is about to end: there is nothing left to stop."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def exit_code() -> int:
    """Of a command that was interrupted: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP."""
    return BY_SIGNAL + _first[0]
