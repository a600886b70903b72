"""BLAS on one thread while this package computes, and on as many as before afterwards.

Threads change the order in which BLAS sums, and with it the last bits of a result: on one thread a run repeats bit by
bit. Three libraries matter: NumPy's, SciPy's, and the one in CasADi's wheel with which MUMPS factorises for IPOPT. The
number of threads belongs to the process: while this package computes in one thread, other threads have one as well.
"""

from __future__ import annotations

import threading
from contextlib import ContextDecorator
from functools import cache
from importlib import import_module
from typing import Any

import threadpoolctl


class _OfCasadi(threadpoolctl.LibController):  # type: ignore[misc]  # threadpoolctl is untyped
    """OpenBLAS in CasADi's wheel, under a name that threadpoolctl does not know."""

    user_api = "blas"
    internal_api = "openblas of casadi"
    filename_prefixes = ("libcasadi-tp-openblas",)
    check_symbols = ("openblas_get_num_threads", "openblas_set_num_threads")

    def get_num_threads(self) -> int:
        return int(self.dynlib.openblas_get_num_threads())

    def set_num_threads(self, num_threads: int) -> None:
        self.dynlib.openblas_set_num_threads(num_threads)

    def get_version(self) -> None:
        return None


threadpoolctl.register(_OfCasadi)


@cache
def _controller() -> Any:
    """Of the libraries that are loaded; to look for them takes some 10 ms, so it is done once."""
    import_module("casadi").has_nlpsol("ipopt")  # loads IPOPT, and its BLAS with it
    import_module("scipy.linalg")
    return threadpoolctl.ThreadpoolController()


def _release() -> None:
    """Lets any thread set limits: threadpoolctl 3.8 and later ignores all but the one that was first."""
    for library in _controller().lib_controllers:
        if hasattr(library, "clear_controlling_thread"):
            library.clear_controlling_thread(force=True)


class _OneThread(ContextDecorator):
    """Nests, and may be entered by several threads: the last one to leave puts back what the first one found."""

    def __init__(self) -> None:
        self.lock, self.depth = threading.Lock(), 0
        self.limiter: Any = None

    def __enter__(self) -> None:
        with self.lock:
            if self.depth == 0:
                _release()
                self.limiter = _controller().limit(limits=1, user_api="blas")
            self.depth += 1

    def __exit__(self, *reason: object) -> None:
        with self.lock:
            self.depth -= 1
            if self.depth == 0:
                _release()
                self.limiter.restore_original_limits()
                _release()


one_blas_thread = _OneThread()
"""Context manager, and decorator of everything that is public and computes."""
