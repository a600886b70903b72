"""Every number a paper reports beside ours: ``reproduce("hybrid-spline")``."""

from __future__ import annotations

from collections.abc import Callable

from ocp_traj import problems
from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError, UnknownName, quoted
from ocp_traj.progress import Progress, silent
from ocp_traj.reproductions import hybrid_spline, rotor_353, weld_bezier, wrist_obstacle
from ocp_traj.reproductions.comparison import Comparison, Erratum, Reproduction, Run
from ocp_traj.reproductions.draft import Keep, ignore
from ocp_traj.stopping import stopping

__all__ = ["REGISTRY", "Comparison", "Erratum", "Reproduction", "Run", "names", "reproduce"]

# id: ((seeds, progress, keep) -> Reproduction, seeds if none are given). A new paper is one module and one line here.
REGISTRY: dict[str, tuple[Callable[[int, Progress, Keep], Reproduction], int]] = {
    "hybrid-spline": (hybrid_spline.run, 3),
    "rotor-353": (rotor_353.run, 30),
    "wrist-obstacle": (wrist_obstacle.run, 8),
    "weld-bezier": (weld_bezier.run, 5),
}


def names() -> tuple[str, ...]:
    """Ids of the problems whose paper can be reproduced."""
    return tuple(REGISTRY)


def require_known(name: str) -> None:
    """Raises ``UnknownName`` unless a problem's paper can be reproduced."""
    if name not in REGISTRY:
        known = f"problems whose paper can be reproduced are {', '.join(REGISTRY)}"
        if name in problems.names():
            raise UnknownName(f"nothing of the paper of {name!r} is recorded here; {known}")
        raise UnknownName(f"there is no problem {quoted(name)}; {known}")


@one_blas_thread
def reproduce(name: str, *, seeds: int | None = None, progress: Progress = silent, keep: Keep = ignore) -> Reproduction:
    """Computes what a paper reports, and compares.

    Args:
        name: id of the problem.
        seeds: runs of each stochastic solver, seeds 0, 1, ..; zero leaves these solvers out; the paper's own number,
            or what its claims need, if not given.
        progress: told how far it is.
        keep: given what is finished, as it is found, and all at the end, such as ``ReproductionFolder.keep``.

    Raises:
        KeyboardInterrupt: after Ctrl-C; a comparison with some of its runs would be another one.
    """
    require_known(name)
    run, usual = REGISTRY[name]
    count = usual if seeds is None else seeds
    if not (isinstance(count, int) and count >= 0):
        raise InputError(f"seeds is {seeds!r}; give a whole number, zero or more")
    with stopping() as stop:
        found = run(count, progress, keep)
        stop.check()
    keep(found)
    return found
