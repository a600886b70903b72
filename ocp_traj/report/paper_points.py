"""Points that papers print, where a front of ours has the same objectives."""

from __future__ import annotations

from collections.abc import Sequence

from ocp_traj.problems import hybrid_spline, wrist_obstacle


def paper_points(problem: str, objectives: Sequence[str]) -> dict[str, dict[str, float]]:
    """By label, the values of all the objectives of a front, in their units; empty where a paper prints none.

    What a front carries of its own (``front.info["paper"]``) is not looked at here.
    """
    found: dict[str, dict[str, float]] = {}
    if problem == "hybrid-spline":
        found = {f"paper, {method}": values for method, values in hybrid_spline.TABLE_9.items()}
    elif problem == "wrist-obstacle":
        words = "paper, GA in the plane, limits not given"
        found[words] = {"time": float(wrist_obstacle.TIME), "fitness": float(wrist_obstacle.FITNESS)}
    return {
        label: {name: float(values[name]) for name in objectives}
        for label, values in found.items()
        if all(name in values for name in objectives)
    }
