"""Workers of a Dask cluster that is running: its scheduler and its workers are begun by Dask's own commands.

Its address is Dask's, such as ``tcp://host:8786``; ``tls://host:8786`` takes its certificates from Dask's own
configuration. Dask itself gives the job of a worker that has died to another one, and gives a job up whose workers have
died too often.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

from ocp_traj.errors import InputError, cut, quoted
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.processes import LOOK, TRIES, WorkerDied
from ocp_traj.parallel.remote import do, pickled
from ocp_traj.parallel.workers import Pending, Workers, with_key
from ocp_traj.stopping import current

TIMEOUT = 20.0  # [s] to find the scheduler, and a first worker: our choice
EVERY = 1.0  # [s] between looks at how many workers there are: our choice


class Cluster(Workers):
    """The workers of a Dask cluster.

    Attributes:
        count: how many there are at the moment.
    """

    def __init__(self, address: str, known: Mapping[str, Answer] | None = None) -> None:
        super().__init__(known)
        try:
            from distributed import Client
        except ImportError as error:
            raise InputError("a cluster needs the extra cluster: pip install 'ocp-traj[cluster]'") from error
        try:
            self._client: Any = _client(Client, address)
        except (OSError, ValueError, TypeError) as error:
            raise InputError(
                f"there is no Dask scheduler at {quoted(address)}: {cut(str(error))}; give its address, such as "
                "tcp://host:8786"
            ) from error
        self._pending: list[_Far] = []
        self._counted = -EVERY, 0  # when, and how many there were
        end = time.monotonic() + TIMEOUT
        while not self._number():
            if time.monotonic() > end:
                self.close()
                raise InputError(f"the Dask scheduler at {address} has no worker; begin one: dask worker {address}")
            time.sleep(LOOK)

    @property
    def count(self) -> int:  # type: ignore[override]
        """How many workers there are at the moment."""
        if time.monotonic() - self._counted[0] > EVERY:
            self._counted = time.monotonic(), self._number()
        return self._counted[1]

    def close(self) -> None:
        """Leaves the cluster; it drops the jobs that nobody waits for any more."""
        for one in self._pending:
            one.future.cancel()
        self._pending = []
        self._client.close()

    def _number(self) -> int:
        return len(self._client.nthreads())

    def _begin(self, job: Job) -> Pending:
        self._pending = [one for one in self._pending if not one.future.done()]
        self._pending.append(_Far(self._client, job))
        return self._pending[-1]


def _client(kind: Any, address: str) -> Any:
    try:
        return kind(address, timeout=TIMEOUT, set_as_default=False)
    except AssertionError:  # Dask gives its event loop 10 s to begin, which a busy machine may not have
        return kind(address, timeout=TIMEOUT, set_as_default=False)


class _Far:
    """A job that is with the cluster."""

    def __init__(self, client: Any, job: Job) -> None:
        self.job = job
        self.future: Future[Answer] = client.submit(do, pickled(job), pure=False)
        self.answer: Answer | None = None

    def result(self) -> Answer:
        """The answer; waits for it, while it looks for Ctrl-C."""
        from distributed import KilledWorker

        while not self.future.done():
            current().check()
            time.sleep(LOOK / 10.0)
        if self.answer is None:
            try:
                self.answer = with_key(self.job, self.future.result())
            except KilledWorker as error:
                raise WorkerDied(f"workers of the cluster died {TRIES} times or more at {self.job.words}") from error
        return self.answer
