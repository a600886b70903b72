"""BLAS has one thread while the package computes: the same bytes whatever the number outside, which is put back."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import casadi
import numpy as np
import pytest
import threadpoolctl

from ocp_traj.blas import one_blas_thread
from ocp_traj.errors import InputError
from ocp_traj.formulation.rows import Row
from ocp_traj.problems import load
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.nlp import NLP

ROOT = Path(__file__).parents[1]
SIZE = 250  # of a dense NLP: with two threads its last bits differ


def dense_nlp() -> NLP:
    """A dense quartic with one row; MUMPS factorises its Hessian with BLAS."""
    rng = np.random.default_rng(0)
    x = casadi.MX.sym("x", SIZE)
    root = rng.normal(size=(SIZE, SIZE))
    free = np.full(SIZE, np.inf)
    return NLP.symbolic(
        name="dense",
        x=x,
        f=casadi.bilin(casadi.DM(root @ root.T), x, x) + casadi.sumsqr(x * x - 1.0),
        g=casadi.sum1(x),
        lower_x=-free,
        upper_x=free,
        lower_g=np.zeros(1),
        upper_g=np.ones(1),
        rows=(Row("sum", ""),),
        labels=("x",) * SIZE,
        units=("-",) * SIZE,
    )


def blas_threads() -> dict[str, int]:
    """Of each library that is loaded."""
    return {i["filepath"]: i["num_threads"] for i in threadpoolctl.threadpool_info() if i["user_api"] == "blas"}


def test_the_blas_of_numpy_scipy_and_casadi_have_one_thread_inside_and_as_many_as_before_outside() -> None:
    with one_blas_thread:  # loads all three
        pass
    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        before = blas_threads()
        with one_blas_thread:
            inside = blas_threads()
        assert len(before) >= 3 and any("casadi" in path for path in before)
        assert set(inside.values()) == {1}
        assert blas_threads() == before
        with pytest.raises(InputError):
            load("hybrid-spline", payload=-1.0)
        assert blas_threads() == before


def test_the_last_of_several_threads_puts_back_what_the_first_found() -> None:
    inside, leave = threading.Event(), threading.Event()

    def other() -> None:
        with one_blas_thread:
            inside.set()
            leave.wait()

    with threadpoolctl.threadpool_limits(2, user_api="blas"):
        before = blas_threads()
        with one_blas_thread:
            worker = threading.Thread(target=other)
            worker.start()
            inside.wait()
        assert set(blas_threads().values()) == {1}
        leave.set()
        worker.join()
        assert blas_threads() == before


@pytest.mark.slow
def test_ipopt_gives_the_same_bytes_whatever_the_number_of_threads() -> None:
    nlp, found = dense_nlp(), []
    for count in (1, 2):
        with threadpoolctl.threadpool_limits(count, user_api="blas"):
            found.append(Ipopt(tol=1e-6).solve(nlp, np.linspace(0.0, 1.0, SIZE)))
    assert found[0].ok
    assert found[0].x.tobytes() == found[1].x.tobytes()


@pytest.mark.slow
def test_solve_and_nsga2_give_the_same_bytes_whatever_the_environment_says() -> None:
    program = (
        "import hashlib, ocp_traj as ot; p = ot.problems.load('hybrid-spline'); x = ot.solve(p, seed=1).x.tobytes();"
        "f = ot.pareto(p, ['time', 'energy'], method='nsga2', population=40, generations=15, seed=1);"
        "print(hashlib.sha256(x + b''.join(q.x.tobytes() for q in f.points)).hexdigest())"
    )
    found = set()
    for count in ("1", "2", None):
        environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
        environment |= {} if count is None else {"OPENBLAS_NUM_THREADS": count}
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, cwd=ROOT, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        found.add(done.stdout)
    assert len(found) == 1
