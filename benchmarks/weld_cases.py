"""Seams of weld-bezier without touching a setting: joints, weld speeds, numbers of tags, and mixtures of them.

    python benchmarks/weld_cases.py

Each line is solved at the default weights and proved, and then for the shortest time in the air.
"""

import time

import ocp_traj as ot

# psi [deg], weld speed [m/s], tags
CASES = (
    (60.0, 0.008, 9), (90.0, 0.008, 9), (45.0, 0.008, 9),
    (60.0, 0.005, 9), (60.0, 0.012, 9),
    (60.0, 0.008, 5), (60.0, 0.008, 17),
    (90.0, 0.005, 13), (90.0, 0.012, 17), (90.0, 0.012, 5),
    (45.0, 0.005, 17), (45.0, 0.012, 13), (45.0, 0.012, 7),
)  # fmt: skip
HEAD = (
    "psi",
    "mm/s",
    "tags",
    "objective",
    "status",
    "audit",
    "air [s]",
    "rms [mm]",
    "max [mm]",
    "tilt",
    "rounds",
    "it.",
)
WIDTHS = (4, 5, 5, 10, 9, 9, 8, 9, 9, 6, 7, 6, 8)


def main() -> None:
    """Prints the table."""
    _print(*HEAD, "s")
    for psi, speed, tags in CASES:
        for objective in ("total", "air_time"):
            begun = time.perf_counter()
            problem = ot.problems.load("weld-bezier", psi=psi, weld_speed=speed, tags=tags)
            solution = ot.solve(problem, objective=objective)
            seconds = time.perf_counter() - begun
            verdict, air, rms, most, tilt = "-", "-", "-", "-", "-"
            if solution.trajectory is not None and solution.audit is not None and problem.about.figures is not None:
                figures = problem.about.figures(solution.trajectory)
                rms, most, tilt = f"{figures[0][1]:.4f}", f"{figures[1][1]:.4f}", f"{figures[2][1]:.3f}"
                verdict, air = solution.audit.verdict, f"{solution.objectives['air_time']:.3f}"
            _print(
                f"{psi:g}", f"{1e3 * speed:g}", str(tags), objective, solution.status.value, verdict, air, rms, most,
                tilt, str(solution.rounds), str(solution.iterations), f"{seconds:.1f}",
            )  # fmt: skip


def _print(*cells: str) -> None:
    print("".join(cell.rjust(width) for cell, width in zip(cells, WIDTHS, strict=True)), flush=True)


if __name__ == "__main__":
    main()
