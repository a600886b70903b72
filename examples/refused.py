"""A proof refused: a grid of instants finds a motion within its limits, and between the instants it is not.

    python examples/refused.py [PICTURE.png]

The shortest motion of ``hybrid-spline`` whose limits are rows at ten instants of each segment, as most solvers have
them; then the same problem by exchange, which ends with a proof.
"""

import sys

import numpy as np

import ocp_traj as ot
from ocp_traj.formulation.scalarise import WeightedSum
from ocp_traj.results.trajectory import trajectory_of
from ocp_traj.solvers.exchange import Exchange
from ocp_traj.solvers.ipopt import Ipopt
from ocp_traj.transcription.instants import uniform_instants
from ocp_traj.transcription.transcription import transcribe

SAMPLES = 10  # a segment
AROUND = 0.04  # [s] on either side, of the picture
TIME = WeightedSum({"time": 1.0})

problem = ot.problems.load("hybrid-spline")
start = problem.guess(np.random.default_rng(0))
grid = uniform_instants(problem, SAMPLES)
sampled = Ipopt().solve(transcribe(problem, TIME, grid, back_off=0.0), start)
motion = trajectory_of(problem, sampled.x)
found = ot.audit(motion, problem.requirements)
print(f"{SAMPLES} instants a segment: {sampled.status.value}, {sampled.f:.5f} s")
print(found.explain())

solution = Exchange().solve(problem, TIME, start)
assert solution.audit is not None
print(f"exchange: {solution.f:.5f} s")
print(solution.audit.explain())

if len(sys.argv) > 1:
    from matplotlib.figure import Figure

    worst = found.failures[0]
    joint = problem.requirements.joints.index(worst.label)
    around = worst.instant + np.linspace(-AROUND, AROUND, 400)
    knots, durations = motion.curve.knots, motion.curve.durations
    places = {(i.segment, i.u) for i in grid if i.limit == worst.limit}
    at = np.array(sorted(float(knots[k] + u * durations[k]) for k, u in places))
    at = at[np.abs(at - worst.instant) < AROUND]
    speeds = motion.curve(at, 1)[:, joint]
    assert speeds.max() < worst.bound * (1.0 + 1e-7)  # IPOPT's own tolerance
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.axhline(worst.bound, color="#c0392b", linestyle="--", label=f"limit, {worst.bound:g} {worst.unit}")
    axes.plot(around, motion.curve(around, 1)[:, joint], color="#1f4e79", label=f"velocity of {worst.label}")
    axes.plot(at, speeds, "o", color="#1f4e79", label="instants at which the limit was imposed")
    axes.plot([worst.instant], [worst.attained], "X", markersize=10, color="#c0392b",
              label=f"{worst.verdict}: {worst.attained:.6f} {worst.unit} at {worst.instant:.4f} s")  # fmt: skip
    axes.set_ylim(0.996 * worst.bound, 1.006 * worst.bound)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"velocity [{worst.unit}]")
    axes.set_title(f"the optimum of {SAMPLES} instants a segment, {sampled.f:.4f} s: refused", fontsize=10)
    axes.legend(fontsize=8, ncols=2, loc="upper center")
    figure.savefig(sys.argv[1], dpi=110)
