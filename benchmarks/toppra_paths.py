"""Random paths of a UR5 through six points, their geometry kept, beside TOPP-RA: durations, proofs, seconds, excess.

TOPP-RA (Pham and Pham, 2018, IEEE T-RO 34(3)) with constant accelerations between 1000 grid points and the collocation
scheme that interpolates, its best here; both go through the same spline over chord length, from rest to rest. Its
excess over limits is that of its own trajectory on a dense grid, ours what is not ruled out by the proof. With bounded
jerk, which it has not, the paths are solved and proved as well, and last longer. One warm process, building included.

    python -m benchmarks.toppra_paths [--paths 50] [--pieces 16]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import casadi
import numpy as np
import toppra
from toppra.algorithm import TOPPRA
from toppra.constraint import (
    DiscretizationType,
    JointAccelerationConstraint,
    JointTorqueConstraint,
    JointVelocityConstraint,
)
from toppra.interpolator import AbstractGeometricPath

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.paths.joint_path import JointPath
from tests.quintics import wander
from tests.retimed import arm, retimed

SEED = 0  # of the first path; the others follow
POINTS, GRID, SCAN = 6, 1000, 20_001
ACCELERATION, JERK = 8.0, 60.0  # [rad/s2], [rad/s3]: our choice, as of the other benchmarks
FAST, PAYLOAD = 20.0, 5.0  # [rad/s2], [kg]: our choice, so that torques are what limits


class Torques:
    """Torques of the arm as TOPP-RA asks for them, and on many states at once."""

    def __init__(self, robot: ot.Robot, payload: float) -> None:
        """Compiles them."""
        q, v, a = (casadi.SX.sym(name, robot.size) for name in "qva")
        self._one = casadi.Function("torque", [q, v, a], [robot.effort(q, v, a, payload=payload)])

    def __call__(self, q: Array, v: Array, a: Array) -> Array:
        """Of states ``(dof,)`` or ``(N, dof)``."""
        states = [np.atleast_2d(part).T for part in (q, v, a)]
        return np.array(self._one.map(states[0].shape[1])(*states)).T.reshape(np.shape(q))


def theirs(robot: ot.Robot, path: JointPath, payload: float | None) -> tuple[float, float, float]:
    """TOPP-RA's duration [s], its largest excess over a limit relative to that, and its seconds."""
    begun = time.perf_counter()
    length = path.curve.duration
    spline = toppra.SplineInterpolator(path.curve.knots, path.points)
    assert isinstance(spline, AbstractGeometricPath)
    dense = np.linspace(0.0, length, 101)
    assert np.abs(spline(dense) - path.curve(dense)).max() < 1e-9, "not the same path"
    bounds = [np.array(robot.limits.bounds(name)) for name in ("velocity", "acceleration", "effort")]
    limits = [JointVelocityConstraint(bounds[0].T), JointAccelerationConstraint(bounds[1].T)]
    torques = None if payload is None else Torques(robot, payload)
    if torques is not None:
        limits.append(JointTorqueConstraint(torques, bounds[2].T, np.zeros(robot.size)))
    for limit in limits[1:]:
        limit.set_discretization_type(DiscretizationType.Interpolation)
    grid = np.linspace(0.0, length, GRID + 1)
    found = TOPPRA(limits, spline, gridpoints=grid, parametrizer="ParametrizeConstAccel").compute_trajectory()
    seconds = time.perf_counter() - begun
    times = np.linspace(0.0, found.duration, SCAN)
    v, a = found(times, 1), found(times, 2)
    shares = [np.abs(v) / bounds[0][1], np.abs(a) / bounds[1][1]]
    if torques is not None:
        shares.append(np.abs(torques(found(times), v, a)) / bounds[2][1])
    return float(found.duration), max(float(share.max()) for share in shares) - 1.0, seconds


def ours(robot: ot.Robot, path: JointPath, pieces: int, payload: float | None) -> tuple[float, bool, float, float]:
    """Duration [s], whether it is proved, the largest excess over a limit that is not ruled out, seconds."""
    begun = time.perf_counter()
    rest = 1 if robot.limits.jerk is None else 2
    found = ot.solve(retimed(robot, path, pieces, rest=rest, payload=payload), certify=False)
    seconds = time.perf_counter() - begun
    if not found.ok or found.audit is None:
        return np.inf, False, np.inf, seconds
    beyond = [-row.margin for row in found.audit.rows if row.boxes]
    return found.f, found.audit.proved, max(0.0, *beyond), seconds


def report(title: str, robot: ot.Robot, paths: Sequence[JointPath], pieces: int, payload: float | None) -> bool:
    """Solves all paths and prints a line; whether all are proved."""
    mine = np.array([ours(robot, path, pieces, payload) for path in paths])
    other = np.array([theirs(robot, path, payload) for path in paths])
    ratios = mine[:, 0] / other[:, 0]
    words = "" if robot.limits.jerk is None else ", which has no jerk limits"
    print(
        f"{title}; {pieces} pieces: {int(mine[:, 1].sum())} of {len(paths)} proved, excess up to "
        f"{100.0 * mine[:, 2].max():.3g} %; duration over TOPP-RA's{words}: median {np.median(ratios):.4f}, worst "
        f"{ratios.max():.4f}; seconds: median {np.median(mine[:, 3]):.2f}, worst {mine[:, 3].max():.2f}; TOPP-RA: "
        f"excess median {100.0 * np.median(other[:, 1]):.3f} %, up to {100.0 * other[:, 1].max():.3f} %, seconds: "
        f"median {np.median(other[:, 2]):.2f}", flush=True,
    )  # fmt: skip
    return bool(mine[:, 1].all())


def main() -> None:
    """Prints three lines."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--paths", type=int, default=50)
    parser.add_argument("--pieces", type=int, default=16, help="from one point to the next")
    asked = parser.parse_args()
    toppra.setup_logging("ERROR")
    robot, strong, smooth = (
        arm(acceleration=ACCELERATION),
        arm(acceleration=FAST),
        arm(acceleration=ACCELERATION, jerk=JERK),
    )
    paths = [JointPath.through(wander(POINTS, SEED + i), robot.joints) for i in range(asked.paths)]
    ot.solve(retimed(robot, paths[0], 2))  # warm
    done = [
        report(f"velocity, acceleration {ACCELERATION:g}", robot, paths, asked.pieces, None),
        report(f"velocity, acceleration {FAST:g}, torque with {PAYLOAD:g} kg", strong, paths, asked.pieces, PAYLOAD),
        report(f"velocity, acceleration {ACCELERATION:g}, jerk {JERK:g}", smooth, paths, asked.pieces // 2, None),
    ]
    raise SystemExit(not all(done))


if __name__ == "__main__":
    main()
