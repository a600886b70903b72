"""What workers save, by a clock that other processes cannot disturb.

Run with ``python -m benchmarks.workers [--points POINTS] [--starts STARTS] [--only NAME] [WORKERS ..]``. Each piece of
work is done in this process, job by job, and timed by the processor's time it takes; a clock of its own adds up when
its answer would have come if so many workers shared the jobs, each begun when a worker is free, and the process that
asks did its own part meanwhile. It leaves out how workers begin, a few seconds once, and what two processes take from
each other's memory.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import ocp_traj as ot
from ocp_traj.parallel.job import Answer, Job
from ocp_traj.parallel.workers import Pending, Workers, with_key


class Clocked(Workers):
    """Workers that are only reckoned with.

    Attributes:
        count: how many.
        jobs: seconds of all jobs together.
        wasted: of those, whose answer nobody has asked for.
    """

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count, self.jobs, self.wasted = count, 0.0, 0.0
        self._free = [0.0] * count
        self._waited, self._begun = 0.0, time.process_time()

    @property
    def own(self) -> float:
        """Seconds of the process that asks."""
        return time.process_time() - self._begun - self.jobs

    @property
    def now(self) -> float:
        """The clock."""
        return self.own + self._waited

    def _begin(self, job: Job) -> Pending:
        now, before = self.now, time.process_time()
        answer = with_key(job, job.do())
        seconds = time.process_time() - before
        self.jobs += seconds
        self.wasted += seconds
        first = min(range(self.count), key=self._free.__getitem__)
        self._free[first] = max(self._free[first], now) + seconds
        return _Done(self, answer, seconds, self._free[first])

    def wait_until(self, moment: float) -> None:
        """Lets the clock go on to a moment."""
        self._waited += max(moment - self.now, 0.0)


class _Done:
    def __init__(self, workers: Clocked, answer: Answer, seconds: float, moment: float) -> None:
        self.workers, self.answer, self.seconds, self.moment = workers, answer, seconds, moment

    def result(self) -> Answer:
        self.workers.wait_until(self.moment)
        self.workers.wasted -= self.seconds
        self.seconds = 0.0
        return self.answer


def _front(name: str, objectives: tuple[str, ...], points: int, workers: Any) -> Any:
    return ot.pareto(ot.problems.load(name), objectives, points=points, workers=workers)


def _starts(name: str, starts: int, workers: Any) -> Any:
    return ot.solve(ot.problems.load(name), starts=starts, certify=False, workers=workers)


def main(points: int, starts: int, counts: list[int], only: str) -> None:
    """Prints a line for each piece of work and number of workers."""
    work: dict[str, Callable[[Any], Any]] = {
        f"hybrid-spline, front of {points} points": partial(_front, "hybrid-spline", ("time", "energy"), points),
        f"weld-bezier, front of {points} points": partial(_front, "weld-bezier", ("air_time", "movement"), points),
        f"hybrid-spline, {starts} starts": partial(_starts, "hybrid-spline", starts),
        f"weld-bezier, {starts} starts": partial(_starts, "weld-bezier", starts),
    }
    print(f"{'work':<36} {'workers':>7} {'alone':>8} {'seconds':>8} {'wasted':>7} {'ratio':>6}")
    _front("hybrid-spline", ("time", "energy"), 2, Workers())  # what is imported late
    for name, call in work.items():
        for count in counts if only in name else []:
            clocked = Clocked(count)
            call(clocked)
            alone = clocked.own + clocked.jobs - clocked.wasted  # without workers the same jobs are done but the wasted
            figures = f"{count:7d} {alone:8.2f} {clocked.now:8.2f} {clocked.wasted:7.2f}"
            print(f"{name:<36} {figures} {alone / clocked.now:6.2f}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="What workers save, by a clock of its own.")
    parser.add_argument("--points", type=int, default=40, help="of a front")
    parser.add_argument("--starts", type=int, default=64, help="of a solve")
    parser.add_argument("--only", default="", help="work with this in its name")
    parser.add_argument("workers", type=int, nargs="*", default=[2, 4])
    given = parser.parse_args()
    main(given.points, given.starts, given.workers, given.only)
