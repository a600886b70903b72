"""Tables 5, 6, 8 and 9 and Figure 15 of Guo et al. (2016) from Table 7's intervals, beside what the paper prints.

Two findings carry the comparison of Table 8: its x, y, z are the tool positions of joint coordinates rounded to four
decimals in m and rad, and the extra knots 2 and 12 follow from Table 7's intervals. Two carry Table 9: the payload is a
constant force along the tool's own axis (``paper-literal``), and inertias about centres of mass stand where those about
the frames' origins belong, as in Table 5.
"""

from __future__ import annotations

from math import pi

import casadi
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from ocp_traj.arrays import Array
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import cubic_spline_free_ends
from ocp_traj.formulation.problem import Problem
from ocp_traj.problems import hybrid_robot
from ocp_traj.problems import hybrid_spline as paper
from ocp_traj.reproductions.comparison import Sheet, rounding_effect
from ocp_traj.transcription.symbolic import objective_function

SECONDS = {"NSGA-II, best": 74.55, "fmincon, mean of 100": 1032.78}  # sect. 6; the second for all 100 starts
PAYLOAD_RANGE = ("0", "10")  # m_pl, m_pu of (123) [kg], Table 1
TRACKING_ERROR = {"standard deviation": "0.0840", "variance": "0.0071", "maximum": "0.2933"}  # [mm, mm2, mm], Fig. 15

# Tables as printed, digit by digit and misprints included: how many digits there are says how precise they are.
# Table 5: number, J11, J22, J33 [kg mm^2], m x, m y, m z [kg mm] of the pseudo-inertia (102).
TABLE_5_PRINTED = """
2  282114.412  2085578.353  3009592.428      0          0        -3668.210
3  901260.608  2085578.353  3009592.428  -6497.242   -27.860     -3668.210
4    6071.881   103321.719    38944.257      0       -510.889    -3755.403
5    5331.503    88745.074    30828.605      0.501   -482.530    -2382.517
"""
# Table 6: knot, X_S1, X_S2, X_S3 [mm], phi_4, phi_5 [rad], x, y, z [mm].
TABLE_6_PRINTED = """
 1  262.63  142.92  367.10  -1.030   1.028   600      -150      1200
 2  264.82  149.16  361.35  -1.0374  1.0253  605.375  -146.070  1194.164
 3  279.40  189.61  325.12  -1.082   0.993   640      -120      1157
 4  298.23  236.26  288.21  -1.117   0.918   680       -90      1118
 5  319.14  284.04  255.31  -1.149   0.838   720       -60      1083
 6  341.88  333.02  223.38  -1.179   0.752   760       -30      1052
 7  366.21  383.29  201.39  -1.206   0.662   800         0      1025
 8  391.95  434.95  180.26  -1.232   0.566   840        30      1002
 9  418.93  488.14  162.95  -1.257   0.466   880        60       983
10  447.03  543.04  149.39  -1.280   0.361   920        90       968
11  476.11  599.93  139.50  -1.303   0.252   960       120       957
12  502.37  651.71  134.09  -1.3412  0.2045  993.187   144.873  9.51221
13  507.92  662.77  132.92  -1.350   0.197  1000       150       950
"""
# Table 8: knot, t [s], X_S1, X_S2, X_S3 [mm], phi_4, phi_5 [rad], x, y, z [mm].
TABLE_8_PRINTED = """
 1  0      262.63  142.92  367.10  -1.030  1.028   599.974  -149.996  1199.998
 2  0.330  263.57  145.35  364.92  -1.033  1.027   602.064  -148.530  1197.757
 3  1.167  279.40  189.61  325.12  -1.082  0.993   639.988  -120.009  1156.971
 4  1.970  298.23  236.26  288.21  -1.117  0.918   680.018   -89.937  1117.988
 5  2.530  319.14  284.04  255.31  -1.149  0.838   719.961   -59.994  1082.990
 6  3.016  341.88  333.02  223.38  -1.179  0.752   759.998   -30.042  1052.018
 7  3.397  366.21  383.29  201.39  -1.206  0.662   799.999     0.022  1025.016
 8  3.745  391.95  434.95  180.26  -1.232  0.566   839.951    30.000  1002.038
 9  4.093  418.93  488.14  162.95  -1.257  0.466   879.967    59.997   983.048
10  4.485  447.03  543.04  149.39  -1.280  0.361   919.970    89.985   968.014
11  5.037  476.11  599.93  139.50  -1.303  0.252   959.982   119.989   956.999
12  5.769  505.32  667.51  133.42  -1.346  0.1969  996.812   147.566   950.498
13  6.189  507.92  662.77  132.92  -1.350  0.197   999.993   150.042   949.980
"""


PHYSICAL, LITERAL = paper.CONVENTIONS
NSGA_II, FMINCON = paper.TABLE_9  # its two lines
PRINTED = 0.0005  # half a unit of the last digit in Tables 4 [kg, kg mm2, mm] and 7 [s]
SCALES, UNITS = np.array([1e3, 1e3, 1e3, 1.0, 1.0]), ("mm", "mm", "mm", "rad", "rad")
DECIMALS = 4  # to which joint coordinates [m, rad] are rounded before Table 8's x, y, z: our finding
TURNS = ((0.0, 0.0), (0.0, 0.0), (-pi / 2.0, pi / 4.0), (pi, pi / 4.0))  # theta, alpha of links 1-4 [rad], Table 3
EXTRA = (2, 12)  # knots whose position follows from the intervals


def lines(table: str) -> dict[int, list[str]]:
    """Entries as printed by the number their line begins with."""
    return {int(line.split()[0]): line.split()[1:] for line in table.strip().splitlines()}


def knots(h: ArrayLike, order: int = 0) -> Array:
    """Joint coordinates, or a derivative, at the 13 knots ``(13, 5)`` [m, rad], of intervals h ``(12,)`` [s]."""
    curve = cubic_spline_free_ends(paper.via_points(paper.Guo2016()), h)
    return np.stack([*(curve.at(k, 0.0, order).ravel() for k in range(12)), curve.at(11, 1.0, order).ravel()])


def tool_positions(q: ArrayLike) -> Array:
    """Tool positions ``(N, 3)`` [mm] of joint coordinates ``(N, 5)`` [m, rad]."""
    return hybrid_robot.robot().poses(q)[1] * 1e3


def pseudo_inertias(sheet: Sheet) -> None:
    """Table 5 from Table 4 by (102), of which both are rounded."""
    copied: list[str] = []
    printed_lines = lines(TABLE_5_PRINTED).items()
    for (number, printed), (mass, inertia, centre) in zip(printed_lines, hybrid_robot.TABLE_4, strict=True):
        diagonal = np.trace(np.array(inertia)) / 2.0 - np.diag(np.array(inertia))
        moments = mass * np.array(centre)
        slacks = [1.5 * PRINTED] * 3 + [PRINTED * (mass + abs(c)) for c in centre]
        names = ("J11", "J22", "J33", "m x", "m y", "m z")
        for i, (name, ours) in enumerate(zip(names, (*diagonal.tolist(), *moments.tolist()), strict=True)):
            item, slack = f"no. {number} {name}", slacks[i]
            copy = bool(copied) and printed[i] == copied[i] != "0"
            misprint = (f"{ours:.3f}", f"copied from no. {number - 1}; Table 4 gives this") if copy else None
            unit, note = ("kg mm2", "") if i < 3 else ("kg mm", "")
            if name == "m x" and centre[0] == 0.0 and printed[i] != "0":
                note = f"Table 4 puts the centre of mass at x = 0; this would need {float(printed[i]) / mass:.3f} mm"
            sheet.add("Table 5", item, printed[i], ours, unit, slack=slack, misprint=misprint, note=note)
        copied = printed


def via_points(sheet: Sheet) -> None:
    """Table 6: the via points by inverse kinematics, the extra knots from Table 7's intervals."""
    joints, (points, _) = knots(paper.TABLE_7), paper.task_points()
    task = iter(points * 1e3)
    for number, printed in lines(TABLE_6_PRINTED).items():
        extra = number in EXTRA
        note = "no datum: it follows from h, and belongs to other intervals than Table 7's" if extra else ""
        for i, name in enumerate(hybrid_robot.JOINTS):
            ours = float(joints[number - 1, i] * SCALES[i])
            sheet.add("Table 6", f"row {number} {name}", printed[i], ours, UNITS[i], note=note)
        of_printed = tool_positions(np.array([float(text) for text in printed[:5]]) / SCALES)[0]
        for i, (name, ours) in enumerate(zip("xyz", of_printed if extra else next(task), strict=True)):
            note = "forward kinematics of the joint coordinates printed" if extra else "(156)"
            sheet.add("Table 6", f"row {number} {name}", printed[5 + i], float(ours), "mm", note=note)


def spline_knots(sheet: Sheet) -> None:
    """Table 8: instants, knots and tool positions at Table 7's intervals."""
    h = np.array(paper.TABLE_7)
    joints, instants = knots(h), np.append(0.0, np.cumsum(h))
    slack = rounding_effect(knots, h, PRINTED) * SCALES
    rounded, exact = tool_positions(np.round(joints, DECIMALS)), tool_positions(joints)
    for number, (time, *printed) in lines(TABLE_8_PRINTED).items():
        k = number - 1
        sheet.add("Table 8", f"row {number} t", time, float(instants[k]), "s", slack=k * PRINTED)
        for i, name in enumerate(hybrid_robot.JOINTS):
            note = "see x, y, z in the same row" if number in EXTRA else ""
            ours, item = float(joints[k, i] * SCALES[i]), f"row {number} {name}"
            sheet.add("Table 8", item, printed[i], ours, UNITS[i], slack=float(slack[k, i]), note=note)
        for i, name in enumerate("xyz"):
            note = f"of joint coordinates rounded to {DECIMALS} decimals in m and rad; not rounded: {exact[k, i]:.3f}"
            sheet.add("Table 8", f"row {number} {name}", printed[5 + i], float(rounded[k, i]), "mm", note=note)


def tracking_distance(curve: PiecewiseBezier) -> tuple[Array, Array]:
    """Times ``(N,)`` [s], every millisecond, and the tool's distance to (156) ``(N,)`` [mm]."""
    times = np.arange(0.0, float(curve.duration), 1e-3)
    p = tool_positions(curve(times))
    eta = ((p[:, 0] - 600.0) * 0.8 + (p[:, 1] + 150.0) * 0.6) / 50.0
    for _ in range(4):  # Newton's method on (c(eta) - p) c'(eta) = 0
        c = saddle(eta)
        slope = np.stack([40.0 + 0.0 * eta, 30.0 + 0.0 * eta, (c[:, 1] - 100.0) * 0.15 - c[:, 0] / 80.0], axis=1)
        bend = 900.0 / 200.0 - 1600.0 / 3200.0  # d2z/deta2
        step = ((c - p) * slope).sum(axis=1) / ((slope**2).sum(axis=1) + (c - p)[:, 2] * bend)
        eta = eta - step
    return times, np.linalg.norm(c - p, axis=1)


def saddle(eta: Array) -> Array:
    """Points ``(N, 3)`` [mm] of the curve (155), (156)."""
    x, y = 600.0 + 40.0 * eta, -150.0 + 30.0 * eta
    return np.stack([x, y, (y - 100.0) ** 2 / 400.0 - x**2 / 6400.0 + 1100.0], axis=1)


def tracking_error(h: ArrayLike) -> Array:
    """Standard deviation [mm], variance [mm2] and maximum [mm] of the tool's distance to (156), every millisecond."""
    distance = tracking_distance(cubic_spline_free_ends(paper.via_points(paper.Guo2016()), h))[1]
    return np.array([distance.std(), distance.var(), distance.max()])


def tracking(sheet: Sheet) -> None:
    """Figure 15's numbers: how far the spline strays from the curve between the knots."""
    ours, slack = tracking_error(paper.TABLE_7), rounding_effect(tracking_error, paper.TABLE_7, PRINTED)
    for i, (name, printed) in enumerate(TRACKING_ERROR.items()):
        sheet.add(
            "Figure 15",
            name,
            printed,
            float(ours[i]),
            ("mm", "mm2", "mm")[i],
            slack=float(slack[i]),
            note="distance to the curve (156)",
        )


def digits(method: str, objective: str) -> str:
    """An entry of Table 9 as printed: all have three decimals."""
    return f"{paper.TABLE_9[method][objective]:.3f}"


def objectives(sheet: Sheet, problem: Problem) -> None:
    """Table 9's line of NSGA-II: the objectives at Table 7's intervals."""

    def values(h: ArrayLike) -> Array:
        return np.array(objective_function(problem)(np.asarray(h))).ravel()

    convention, names = problem.case.convention, [objective.id for objective in problem.objectives]
    effect = rounding_effect(values, paper.TABLE_7, PRINTED)
    ours, slack = (dict(zip(names, numbers.tolist(), strict=True)) for numbers in (values(paper.TABLE_7), effect))

    def add(name: str, value: float, words: str, note: str = "") -> None:
        unit = problem.objective(name).unit
        sheet.add("Table 9", f"{name}, {words}", digits(NSGA_II, name), value, unit, slack=slack[name], note=note)

    for name in names:
        if convention == LITERAL or name in ("energy", "cost"):  # the others are the same
            add(name, ours[name], convention)
    if convention == LITERAL:
        energy, words = energy_by_table_5(), f"{LITERAL}, Table 5's inertias"
        factor = (problem.objective("cost").terms or {})["energy"]
        add("energy", energy, words, "inertia about the centre of mass in the place of that about the frame's origin")
        add("cost", ours["cost"] + factor * (energy - ours["energy"]), words)


def energy_by_table_5() -> float:
    """z2 at Table 7, paper-literal, with (102) as Table 5 fills it: inertias about centres of mass, not frame origins.

    Efforts are linear in the inertias: they are those of Table 4, less what moving each from centre to origin adds.
    """
    q, v, a = (knots(paper.TABLE_7, order) for order in range(3))
    weight = casadi.vertcat(0.0, 0.0, -paper.Guo2016().payload * hybrid_robot.GRAVITY)
    symbols = [casadi.SX.sym(name, 5) for name in "qva"]
    moved = hybrid_robot.robot()
    for j, ((mass, _, centre), turns) in enumerate(zip(hybrid_robot.TABLE_4, TURNS, strict=True), start=2):
        r = turned(*turns) @ np.array(centre) * 1e-3
        own = moved.model.inertias[j]
        origin = own.inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))
        moved.model.inertias[j] = pin.Inertia(own.mass, own.lever, origin)
    effort = 2.0 * hybrid_robot.robot().effort(*symbols, tool_force=weight) - moved.effort(*symbols, tool_force=weight)
    power = np.array(casadi.Function("effort", symbols, [effort])(q.T, v.T, a.T)) * v.T
    return float(np.trapezoid(np.abs(power).sum(axis=0) ** 2, np.append(0.0, np.cumsum(paper.TABLE_7))))


def turned(theta: float, alpha: float) -> Array:
    """Rotation matrix from a link's frame to its joint's, (9)."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -ca * s, sa * s], [s, ca * c, -sa * c], [0.0, sa, ca]])
