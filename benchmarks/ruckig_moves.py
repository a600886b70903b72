"""Random moves of a UR5, rest to rest, beside Ruckig: durations, proofs and seconds.

Ruckig's duration is the optimum for bounded velocity, acceleration and jerk (Berscheid and Kroeger, 2021), which is
all it knows of; with bounded snap and torques on top the moves are solved and proved as well, and last longer. One warm
process, building included.

    python -m benchmarks.ruckig_moves [--moves 100] [--snap 1500]
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from ruckig import InputParameter, Ruckig, Trajectory

import ocp_traj as ot
from ocp_traj.arrays import Array
from ocp_traj.formulation.levels import usual_levels
from tests.quintics import move, refined, ur5

SEED = 0  # of the first move; the others follow


def optimum(robot: ot.Robot, points: Array) -> float:
    """Ruckig's duration [s] of a move ``(2, dof)``."""
    request, found = InputParameter(robot.size), Trajectory(robot.size)
    request.current_position, request.target_position = points.tolist()
    names = ("max_velocity", "max_acceleration", "max_jerk")
    for order, name in enumerate(names, 1):
        setattr(request, name, robot.limits.bounds(order)[1].tolist())  # type: ignore[index]
    Ruckig(robot.size).calculate(request, found)
    return float(found.duration)


def report(title: str, robot: ot.Robot, moves: list[Array], torque: bool, degree: int = 5) -> bool:
    """Solves all moves and prints a line; whether all are proved."""
    ratios, seconds, proved = [], [], 0
    coarsest, finest = usual_levels(degree, stops_only=True)
    for points in moves:
        begun = time.perf_counter()
        found = ot.solve(refined(robot, points, coarsest, finest, torque=torque, degree=degree))
        seconds.append(time.perf_counter() - begun)
        proved += found.audit is not None and found.audit.proved
        ratios.append(found.f / optimum(robot, points))
    print(
        f"{title}: {proved} of {len(moves)} proved; duration over Ruckig's: median {np.median(ratios):.4f}, "
        f"worst {max(ratios):.4f}; seconds: median {np.median(seconds):.2f}, worst {max(seconds):.2f}", flush=True,
    )  # fmt: skip
    return proved == len(moves)


def main() -> None:
    """Prints three lines."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--moves", type=int, default=100)
    parser.add_argument("--snap", type=float, default=1500.0, help="limit on snap [rad/s4]")
    asked = parser.parse_args()
    moves = [move(SEED + i) for i in range(asked.moves)]
    robot, smooth = ur5(), ur5(snap=(asked.snap,) * 6)
    ot.solve(refined(robot, moves[0], *usual_levels(5, stops_only=True)))  # warm
    done = [
        report("velocity, acceleration, jerk; quintics", robot, moves, torque=False),
        report("and torque; quintics", robot, moves, torque=True),
        report(f"and torque and snap {asked.snap:g}; septics", smooth, moves, torque=True, degree=7),
    ]
    raise SystemExit(not all(done))


if __name__ == "__main__":
    main()
