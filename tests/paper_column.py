"""What a paper's column may hold: for each problem and table the numbers that the paper prints there, and no others."""

from collections.abc import Iterable

from ocp_traj.reproductions import hybrid_spline_tables, rotor_353_errata
from ocp_traj.reproductions.comparison import Comparison, Run
from ocp_traj.reproductions.weld_bezier_tables import TABLE_2


def numbers(*texts: str) -> set[float]:
    """All numbers of some tables as printed."""
    return {float(text) for table in texts for text in table.split()}


PRINTED: dict[str, dict[str, set[float]]] = {
    "hybrid-spline": {
        "Table 5": numbers(hybrid_spline_tables.TABLE_5_PRINTED),
        "Table 6": numbers(hybrid_spline_tables.TABLE_6_PRINTED),
        "Table 8": numbers(hybrid_spline_tables.TABLE_8_PRINTED),
        "Figure 15": {0.0840, 0.0071, 0.2933},
        "Table 9": {3.093, 6.189, 3921.602, 1.068, 0.194},
        "Optimum": {3.093, 3.220},
        "NSGA-II": {3.093},
        "Payload": {12.65, 500.0},
        "Runs": {3.093, 6.189, 3921.602, 1.068, 0.194, 3.220, 7.146, 3250.239, 2.510, 0.252, 74.55, 1032.78},
    },
    "rotor-353": {
        "Table 1": {0.0, 75.0, 450.0, 840.0, 1100.0},
        "Table 2": numbers(rotor_353_errata.TABLE_2_PRINTED),
        "Sect. 4": {0.311, 0.660, 1.676, 2.647, 56.0},
        "Runs": {0.311, 0.660, 1.676, 2.647},
    },
    "wrist-obstacle": {"Sect. 5": {0.2, 8.1}, "Runs": {0.2, 8.1}},
    "weld-bezier": {
        "Table 2": numbers(TABLE_2),
        "Table 7": {1.15},
        "Runs": {1.36, 78401, 0.0171, 0.037, 5567, 1.15, 1448471, 0.670, 0.167, 815},
    },
}


def foreign(name: str, comparisons: Iterable[Comparison], runs: Iterable[Run] = ()) -> list[str]:
    """What stands in the paper's column, or in a row of its own, and is not printed there."""
    allowed = PRINTED[name]
    wrong = [f"{c.table}, {c.item}: {c.paper}" for c in comparisons if c.paper not in (None, *allowed.get(c.table, ()))]
    for run in runs:
        if run.source == "paper":
            values = [*run.objectives.values(), run.seconds, run.evaluations]
            wrong += [f"Runs, {run.method}: {value}" for value in values if value not in (None, *allowed["Runs"])]
    return wrong
