"""Workers that are processes of this machine: spawned, so that nothing of this process is shared with them.

They end with this process, however it ends, and at once when they are closed: each watches a pipe whose other end is
here. Ctrl-C is for this process alone. A worker that dies costs the jobs that were with it a second try; one of those
that dies again with its worker is tried a third time alone, and is then known to be the cause.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection

from ocp_traj.errors import InputError, OcpTrajError
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.remote import do, pickled
from ocp_traj.parallel.workers import Pending, Workers, with_key
from ocp_traj.stopping import current

LOOK = 0.1  # [s] between looks at whether the work should end: our choice
TRIES = 3
MOST = 256  # workers: our choice


class WorkerDied(OcpTrajError):
    """A job ends the process that does it, whichever that is."""


class Processes(Workers):
    """Some processes of this machine, begun when they are first needed.

    Attributes:
        count: how many.
    """

    def __init__(self, count: int, known: Mapping[str, Answer] | None = None) -> None:
        super().__init__(known)
        if not 1 <= count <= MOST:
            raise InputError(f"workers is {count}; give 0, for this process alone, up to {MOST}")
        self.count = count
        self.deaths = 0
        self._pool: _Pool | None = None
        self._pending: list[_There] = []

    def close(self) -> None:
        """Ends the processes at once."""
        pool, self._pool, self._pending = self._pool, None, []
        if pool is not None:
            pool.end()

    def _begin(self, job: Job) -> Pending:
        pending = _There(self, job)
        self._pending = [one for one in self._pending if not one.future.done()] + [pending]
        return pending

    def start(self, pending: _There) -> Future[Answer]:
        """Gives a job to a worker."""
        if self._pool is None:
            self._pool = _Pool(self.count)
        try:
            return self._pool.submit(pending.sent)
        except BrokenProcessPool:  # and nobody has asked for an answer since
            self.restart()
            return self._pool.submit(pending.sent)

    def restart(self) -> None:
        """New workers in place of those of which one has died; what was with them is tried again."""
        self.deaths += 1
        lost = [one for one in self._pending if one.is_lost]
        if self._pool is not None:
            self._pool.end()
        self._pool = _Pool(self.count)
        for one in lost:
            one.tries += 1
            if one.tries < TRIES:
                one.future = self._pool.submit(one.sent)

    def alone(self, pending: _There) -> Answer:
        """The answer of a job whose workers have died twice, by one that has nothing else to do."""
        pool = _Pool(1)
        try:
            return _answer(pool.submit(pending.sent))
        except BrokenProcessPool as error:
            raise WorkerDied(
                f"a worker died {TRIES} times at one job, the last time alone: {pending.job.words}; where that is for "
                "want of memory, take fewer workers. (A script that asks for workers needs "
                'if __name__ == "__main__": around what it runs.)'
            ) from error
        finally:
            pool.end()


class _There:
    """A job that is with a worker, or waits for one."""

    def __init__(self, workers: Processes, job: Job) -> None:
        self.workers, self.job, self.tries = workers, job, 1
        self.sent = pickled(job)
        self.future = workers.start(self)
        self.answer: Answer | None = None

    @property
    def is_lost(self) -> bool:
        """Whether its worker has died."""
        return self.future.done() and isinstance(self.future.exception(), BrokenProcessPool)

    def result(self) -> Answer:
        """The answer; waits for it, while it looks for Ctrl-C."""
        while self.answer is None:
            try:
                found = _answer(self.future) if self.tries < TRIES else self.workers.alone(self)
                self.answer = with_key(self.job, found)
            except BrokenProcessPool:
                if self.is_lost:  # else another one's ``result`` has it begun again
                    self.workers.restart()
        return self.answer


def _answer(future: Future[Answer]) -> Answer:
    while not future.done():
        current().check()
        try:
            future.exception(LOOK)
        except TimeoutError:
            continue
    return future.result()


class _Pool:
    """Processes, and the pipe that ends them."""

    def __init__(self, count: int) -> None:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        self._ours, self._theirs = ours, theirs
        self._executor: Executor = ProcessPoolExecutor(count, context, _begin, (theirs,))

    def submit(self, job: bytes) -> Future[Answer]:
        return self._executor.submit(do, job)

    def end(self) -> None:
        self._ours.close()
        self._theirs.close()
        self._executor.shutdown(wait=True, cancel_futures=True)


def _begin(watched: Connection) -> None:
    """Begins a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    threading.Thread(target=_end_with, args=(watched,), daemon=True).start()


def _end_with(watched: Connection) -> None:
    try:
        watched.poll(None)  # nothing is ever sent: it returns when the other end is closed
    finally:
        os._exit(0)
