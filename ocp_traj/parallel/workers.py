"""Who does the jobs. Here: this process, each job when its answer is needed.

Whoever has jobs submits them, in an order and with a content that do not depend on who does them, and takes the answers
in an order that does not depend on when they came. So the number of workers changes nothing but the time. An answer
that is known already, from the journal of a run that was stopped, is not worked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future
from types import TracebackType
from typing import Protocol, Self

from ocp_traj.parallel.job import Answer, Job
from ocp_traj.results.records import KEY


class Pending(Protocol):
    """A job that was submitted."""

    def result(self) -> Answer:
        """The answer, with the job's key; waits for it. Raises what the job has raised."""


class Elsewhere(Pending, Protocol):
    """A job that is with a worker, or waits for one."""

    future: Future[Answer]


class Workers:
    """This process alone.

    Attributes:
        known: answers by the key of their job.
        count: workers beside this process.
        answered: how many jobs were answered by what was known.
    """

    count = 0

    def __init__(self, known: Mapping[str, Answer] | None = None) -> None:
        self.known = dict(known or {})
        self.answered = 0
        self._pending: Sequence[Elsewhere] = []

    @property
    def ahead(self) -> int:
        """How many jobs are worth submitting beyond the one whose answer is needed next.

        One for each worker, and so one that waits for the first who is done.
        """
        return self.count

    @property
    def busy(self) -> int:
        """How many workers have a job at the moment."""
        return min(self.count, sum(not one.future.done() for one in self._pending))

    def submit(self, job: Job) -> Pending:
        """Begins a job, or finds its answer."""
        known = self.known.get(job.key) if self.known and job.key else None
        if known is not None:
            self.answered += 1
            return _Known(known)
        return self._begin(job)

    def run(self, jobs: Iterable[Job]) -> list[Answer]:
        """The answers of jobs, in their order."""
        pending = [self.submit(job) for job in jobs]
        return [one.result() for one in pending]

    def close(self) -> None:
        """Ends the workers; what they are at is lost."""

    def _begin(self, job: Job) -> Pending:
        return _Here(job)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


class _Known:
    """An answer that was there."""

    def __init__(self, answer: Answer) -> None:
        self.answer = answer

    def result(self) -> Answer:
        return self.answer


class _Here:
    """A job of this process, done when its answer is asked for, once."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self.answer: Answer | None = None

    def result(self) -> Answer:
        if self.answer is None:
            self.answer = with_key(self.job, self.job.do())
        return self.answer


def with_key(job: Job, answer: Answer) -> Answer:
    """An answer that says which job it is of."""
    return {**answer, KEY: job.key}
