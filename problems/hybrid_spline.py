"""Cubic splines for a 5-DOF hybrid robot with a payload. Guo et al. (2016), Shock and Vibration, 1302537.

Decision variables  the 12 intervals h between 13 knots [s]; the payload [kg] if it is freed      sect. 3.2, 5
Curve               cubic splines through 11 via points, at rest at both ends, two free end knots  (130)-(143)
Objectives          time z1, energy z2, jerk z3, acceleration z4, their weighted sum Fc  (112)-(116), (153), (154)
Subject to          position (118), velocity (119), acceleration (120), jerk (121), force (122) for all t; Table 2
Deviations
  The payload is a point mass at the tool frame, so its weight is a force of gravity. The paper's own numbers follow
  from a constant force along the tool's axis: ``convention="paper-literal"``, which also sums |U||v| before squaring.
  Jerk limits of joints 1-3 are 100 m/s^3 (Table 2 prints 100 000 m/s^3, meant are mm). Z0 points down.
  Row 6 of Table 6 must read X_S3 = 226.38; rows 2 and 12 follow from h and are no data. (60) and (67) mix frames, (30)
  lacks a division of A1 by L3. The yaw range below (7) is a limit as well. Bounds on h: (152) where an interval has a
  given displacement, else ``min_interval`` (our choice), and ``max_interval`` (our choice).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import casadi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ocp_traj.chain import AxisJoint, DHRow, LinkInertia
from ocp_traj.curves import cubic_spline_free_ends
from ocp_traj.errors import InputError
from ocp_traj.limits import Limits
from ocp_traj.problem import MIDPOINT, TRAPEZOID, Objective, Problem, Variable
from ocp_traj.requirements import PathConstraint, PointConstraint, Requirements, State
from ocp_traj.robot import ActuatorMap, Robot

Array = NDArray[np.float64]

CONVENTIONS = ("physical", "paper-literal")
VIA_POINTS = ("rederived", "table6")
JOINTS = ("X_S1", "X_S2", "X_S3", "phi_4", "phi_5")
UNITS = ("m", "m", "m", "rad", "rad")
GRAVITY = 9.80665  # [m/s^2], below (42)


@dataclass(frozen=True)
class Guo2016:
    """The paper's numbers; a field is what a user may change."""

    payload: float = 10.0  # m_p [kg], sect. 6
    convention: str = "physical"  # of CONVENTIONS
    weights: tuple[float, float, float, float] = (
        0.3,
        0.3,
        0.2,
        0.2,
    )  # w of time, energy, jerk, acceleration; sect. 3.1
    via_points: str = (
        "rederived"  # of VIA_POINTS: inverse kinematics of (156), or Table 6's digits with row 6 corrected
    )
    min_interval: float = 0.02  # [s], of the four intervals without a displacement: our choice
    max_interval: float = 4.0  # [s], of every interval: our choice
    free_payload: bool = False  # whether the payload is a decision variable; sect. 5
    max_payload: float = 100.0  # [kg], bound on the freed payload: our choice, beyond what the limits allow

    def __post_init__(self) -> None:
        """Checks the fields."""
        if not (np.isfinite(self.payload) and self.payload >= 0.0):
            raise InputError(f"payload is {self.payload} kg; give a finite mass, zero or more")
        if self.convention not in CONVENTIONS:
            raise InputError(f"convention is {self.convention!r}; allowed are {', '.join(CONVENTIONS)}")
        if self.via_points not in VIA_POINTS:
            raise InputError(f"via_points is {self.via_points!r}; allowed are {', '.join(VIA_POINTS)}")
        if (
            len(self.weights) != 4
            or not all(np.isfinite(w) and w >= 0.0 for w in self.weights)
            or not any(self.weights)
        ):
            raise InputError(
                f"weights are {self.weights}; give four numbers, zero or more and not all zero: "
                "time, energy, jerk, acceleration"
            )
        if not 0.0 < self.min_interval < self.max_interval < np.inf:
            raise InputError(
                f"min_interval {self.min_interval} s and max_interval {self.max_interval} s leave no interval; "
                "give 0 < min_interval < max_interval"
            )
        if not (np.isfinite(self.max_payload) and self.max_payload > 0.0):
            raise InputError(f"max_payload is {self.max_payload} kg; give a finite mass above zero")


# Table 1 [m]. L_p: (8), with L_t = 225 mm.
L1, L2, L3, L4, L5, L01, E = 0.420, 0.050, 0.450, 0.180, 0.180, 0.400, 0.0
LP = 0.225 - (0.180 + sqrt(2.0) * 0.080 + E)

# Table 4: mass [kg], inertia about the centre of mass [kg mm^2], centre of mass [mm].
TABLE_4 = (
    (
        83.025,
        ((5095170.782, -61.008, 1019.065), (-61.008, 3291706.841, -15.858), (1019.065, -15.858, 2367692.766)),
        (0.0, 0.0, -44.182),
    ),
    (
        21.333,
        (
            (1475990.573, -3970.014, -748196.633),
            (-3970.014, 2366543.574, -8327.223),
            (-748196.633, -8327.223, 911968.216),
        ),
        (-304.563, -1.306, -278.925),
    ),
    (
        8.022,
        ((142265.977, -0.114, 0.002), (-0.114, 45016.139, 46002.096), (0.002, 46002.096, 109393.601)),
        (0.0, -63.686, -468.138),
    ),
    (
        9.120,
        ((119573.680, 27.342, -0.849), (27.342, 36160.108, -18452.465), (-0.849, -18452.465, 94076.578)),
        (0.0, -52.909, -261.241),
    ),
)

# Table 2, SI.
LIMITS = Limits(
    position=((0.0, 0.0, 0.0, -pi, -pi), (1.0, 1.0, 0.5, pi, pi)),
    velocity=(0.25, 0.25, 0.25, 1.96, 1.96),
    acceleration=(5.0, 5.0, 5.0, 60.0, 60.0),
    jerk=(100.0, 100.0, 100.0, 1200.0, 1200.0),
    effort=(500.0, 500.0, 500.0, 17.0, 17.0),
)

# Table 6: X_S1, X_S2, X_S3 [mm], phi_4, phi_5 [rad] of the 11 via points. Row 6 prints X_S3 = 223.38.
TABLE_6 = (
    (262.63, 142.92, 367.10, -1.030, 1.028),
    (279.40, 189.61, 325.12, -1.082, 0.993),
    (298.23, 236.26, 288.21, -1.117, 0.918),
    (319.14, 284.04, 255.31, -1.149, 0.838),
    (341.88, 333.02, 226.38, -1.179, 0.752),
    (366.21, 383.29, 201.39, -1.206, 0.662),
    (391.95, 434.95, 180.26, -1.232, 0.566),
    (418.93, 488.14, 162.95, -1.257, 0.466),
    (447.03, 543.04, 149.39, -1.280, 0.361),
    (476.11, 599.93, 139.50, -1.303, 0.252),
    (507.92, 662.77, 132.92, -1.350, 0.197),
)


def robot() -> Robot:
    """The 5-DOF hybrid robot: two parallel ball screws that move and yaw link 1, a lift, and two revolute joints."""

    def serial(q: Any) -> Any:  # (90), (92): d1, alpha, X_S3, phi_4, phi_5
        return casadi.vertcat((q[0] + q[1]) / 2.0, casadi.atan((q[1] - q[0]) / L1), q[2], q[3], q[4])

    links = [LinkInertia(mass, np.array(centre) * 1e-3, np.array(inertia) * 1e-6) for mass, inertia, centre in TABLE_4]
    return Robot.from_dh(
        rows=(  # Table 3
            DHRow(d=L01, a=L3, kind="prismatic"),
            DHRow(theta=-pi / 2.0, d=L2 + L4 + sqrt(2.0) * L5, alpha=pi / 4.0),
            DHRow(theta=pi, d=sqrt(2.0) * E, alpha=pi / 4.0),
            DHRow(d=LP, kind="fixed"),
        ),
        inertias=(*links[1:], None),
        prefix=(AxisJoint("prismatic", axis=(1, 0, 0)), AxisJoint("revolute", axis=(0, 0, 1), inertia=links[0])),
        gravity=(0.0, 0.0, GRAVITY),  # Z0 points down
        joints=JOINTS,
        units=UNITS,
        limits=LIMITS,
        actuator_map=ActuatorMap("parallel screws", serial),
        name="hybrid 5-DOF",
    )


def inverse_kinematics(position: ArrayLike, axis: ArrayLike) -> Array:
    """Joint coordinates of tool positions and tool axes, (29)-(32) with A1/L3 in place of A1.

    Args:
        position: p ``(N, 3)`` [m].
        axis: a ``(N, 3)``, unit, a_z > 0; of the two turns about it, the one with n_z <= 0 is taken.

    Returns:
        ``(N, 5)``: X_S1, X_S2, X_S3 [m], phi_4, phi_5 [rad].
    """
    p, a = np.atleast_2d(np.asarray(position, dtype=float)), np.atleast_2d(np.asarray(axis, dtype=float))
    az = a[:, 2]
    nz = -np.sqrt(np.maximum(1.0 - (2.0 * az - 1.0) ** 2, 0.0)) / sqrt(2.0)
    y, x = a[:, 1] * (az - 1.0) + a[:, 0] * nz, a[:, 0] * (az - 1.0) - a[:, 1] * nz
    sine = (p[:, 1] - LP * a[:, 1] + (E * y / ((az - 1.0) ** 2 + nz**2) if E else 0.0)) / L3
    if (np.abs(sine) > sqrt(0.5)).any():
        raise InputError("inverse kinematics: a position is out of reach, its yaw lies beyond +-45 deg (below (7))")
    alpha = np.arcsin(sine)
    phi5 = np.arctan2(-sqrt(2.0) * nz, 2.0 * az - 1.0)
    phi4 = np.arctan2(y, x) - alpha
    phi4 = np.arctan2(np.sin(phi4), np.cos(phi4))
    middle = p[:, 0] + E * np.cos(alpha + phi4) - L3 * np.cos(alpha) - LP * a[:, 0]
    half = 0.5 * L1 * np.tan(alpha)
    lift = p[:, 2] - (L2 + L4 + sqrt(2.0) * L5 + L01 + E + az * LP)
    return np.asarray(np.stack([middle - half, middle + half, lift, phi4, phi5], axis=1))


def task_points() -> tuple[Array, Array]:
    """Positions ``(11, 3)`` [m] of (156), tool axes ``(11, 3)``: normal to the curve in its vertical plane, a_z > 0."""
    eta = np.arange(11.0)
    x, y = 600.0 + 40.0 * eta, -150.0 + 30.0 * eta
    z = (y - 100.0) ** 2 / 20.0**2 - x**2 / 80.0**2 + 1100.0
    slope = np.gradient(z, 50.0)  # dz/ds_xy: 50 mm between points, seen from above
    axis = np.stack([-0.8 * slope, -0.6 * slope, np.ones(11)], axis=1) / np.sqrt(1.0 + slope**2)[:, None]
    return np.stack([x, y, z], axis=1) * 1e-3, axis


def via_points(case: Guo2016) -> Array:
    """The 11 via points in joint space ``(11, 5)`` [m, rad]."""
    if case.via_points == "table6":
        return np.asarray(np.array(TABLE_6) * np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0]))
    return inverse_kinematics(*task_points())


# Of the default case, each with another within the reference point; python benchmarks/ideal_points.py hybrid-spline
BEST = {
    "time": {"energy": 2.63615, "jerk": 2.56714, "acceleration": 2.48362},
    "energy": {"time": 1565.21, "jerk": 355.639, "acceleration": 355.639},
    "jerk": {"time": 0.0805246, "energy": 6.56202e-05, "acceleration": 6.56202e-05},
    "acceleration": {"time": 0.0531675, "energy": 0.00050263, "jerk": 0.00050263},
}


def build(case: Guo2016 | None = None) -> Problem:
    """The problem of a case."""
    case = case or Guo2016()
    machine, points = robot(), via_points(case)
    literal = case.convention == "paper-literal"

    def force(s: State) -> Any:
        if literal:  # (73) with 5f5 not turned into the world: a constant force along the tool's own axis
            return machine.effort(s.q, s.v, s.a, tool_force=casadi.vertcat(0.0, 0.0, -s.p[0] * GRAVITY))
        return machine.effort(s.q, s.v, s.a, payload=s.p[0])

    def energy(s: State) -> Any:
        power = force(s) * s.v
        return casadi.sum1(casadi.fabs(power)) ** 2 if literal else casadi.sumsqr(power)

    steps = np.abs(np.diff(points, axis=0)) / LIMITS.velocity[1]
    lower = np.full(12, case.min_interval)
    lower[2:-2] = steps.max(axis=1)[1:-1]  # (152)
    intervals = Variable("h", lower, np.full(12, case.max_interval), "s", tuple(f"h{i}" for i in range(1, 13)), "(152)")
    mass = Variable("payload", np.zeros(1), np.array([case.max_payload]), "kg", ("payload",), "(123)")
    variables = (intervals, mass) if case.free_payload else (intervals,)

    objectives = [
        Objective("time", "s", 1.0, eq="(113)", of_variables=lambda x, p: casadi.sum1(x[:12])),
        Objective("energy", "N2 m2/s", 1000.0, eq="(114)", integrand=energy, quadrature=TRAPEZOID),
        Objective(
            "jerk", "(m2+rad2)/s5", 10.0, eq="(115)", integrand=lambda s: casadi.sumsqr(s.jerk), quadrature=MIDPOINT
        ),
        Objective(
            "acceleration",
            "(m2+rad2)/s3",
            1.0,
            eq="(116)",
            integrand=lambda s: casadi.sumsqr(s.a),
            quadrature=TRAPEZOID,
        ),
    ]
    terms = {o.id: w / o.scale for o, w in zip(objectives, case.weights, strict=True)}
    objectives.append(Objective("cost", "-", 1.0, eq="(112), (153)", terms=terms))
    if case.free_payload:
        objectives.append(
            Objective("payload_mass", "kg", 10.0, sense="max", eq="(123)", of_variables=lambda x, p: x[12])
        )

    def guess(rng: np.random.Generator) -> Array:
        # Step 3 of sect. 4: random intervals above (152); the first and last displacement cut in two at random.
        h = np.zeros(12)
        least = steps.max(axis=1)
        whole = least * rng.uniform(1.2, 4.0, 10)
        cut = rng.uniform(0.2, 0.8, 2)
        h[2:-2] = whole[1:-1]
        h[:2], h[-2:] = whole[0] * np.array([cut[0], 1 - cut[0]]), whole[-1] * np.array([cut[1], 1 - cut[1]])
        h = np.clip(h, lower, case.max_interval)
        return np.append(h, rng.uniform(0.0, min(10.0, case.max_payload))) if case.free_payload else h

    kinds = (
        ("position", "(118)", ""),
        ("velocity", "(119)", "/s"),
        ("acceleration", "(120)", "/s2"),
        ("jerk", "(121)", "/s3"),
    )
    limits = []
    for order, (name, eq, per) in enumerate(kinds):
        lower_bound, upper_bound = getattr(LIMITS, name)
        units = tuple(unit + per for unit in UNITS)
        limits.append(PathConstraint.on_derivative(f"{name}-limit", order, lower_bound, upper_bound, units, JOINTS, eq))
    weakest, strongest = LIMITS.effort
    forces = ("F1", "F2", "F3", "tau4", "tau5")
    limits.append(PathConstraint("force", force, weakest, strongest, machine.effort_units, forces, "(122)"))
    yaw = np.array([L1])
    limits.append(PathConstraint("yaw", lambda s: s.q[1] - s.q[0], -yaw, yaw, ("m",), ("X_S2 - X_S1",), "(7)"))
    rest = PointConstraint(
        "rest", lambda s: casadi.vertcat(s.v, s.a), ((0, 0.0), (-1, 1.0)), np.zeros(10), np.zeros(10),
        tuple(f"{u}/s" for u in UNITS) + tuple(f"{u}/s2" for u in UNITS),
        tuple(f"v {j}" for j in JOINTS) + tuple(f"a {j}" for j in JOINTS), "sect. 3.2", structural=True,
    )  # fmt: skip
    knots = ((0, 0.0), *((k, 0.0) for k in range(2, 11)), (-1, 1.0))
    via = PointConstraint("via", lambda s: s.q, knots, points, points, UNITS, JOINTS, "(127)", structural=True)
    return Problem(
        id="hybrid-spline",
        title="5-DOF hybrid robot, cubic splines, payload",
        reference="Guo et al. (2016), doi:10.1155/2016/1302537",
        case=case,
        robot=machine,
        variables=variables,
        curve=lambda x: cubic_spline_free_ends(points, x[:12]),
        curve_kind="cubic spline, 12 segments, free end knots",
        parameters=lambda x: x[12:13] if case.free_payload else casadi.SX(case.payload),
        objectives=tuple(objectives),
        default_objective="cost",
        reference_point={"time": 8.0, "energy": 6000.0, "jerk": 100.0, "acceleration": 5.0},
        best_values=BEST if case == Guo2016() else {},
        requirements=Requirements(JOINTS, UNITS, tuple(limits), (rest, via), ("payload",), continuity=2),
        guess=guess,
        dilate=lambda x, s: np.concatenate([np.asarray(x)[:12] * s, np.asarray(x)[12:]]),
    )


# What the paper reports.
TABLE_7 = (0.330, 0.837, 0.803, 0.569, 0.477, 0.382, 0.348, 0.348, 0.392, 0.552, 0.732, 0.420)  # h [s]
TABLE_9 = {  # Fc, z1 .. z4
    "NSGA-II, best": {"cost": 3.093, "time": 6.189, "energy": 3921.602, "jerk": 1.068, "acceleration": 0.194},
    "fmincon, mean of 100": {"cost": 3.220, "time": 7.146, "energy": 3250.239, "jerk": 2.510, "acceleration": 0.252},
}
SECONDS = {"NSGA-II, best": 74.55, "fmincon, mean of 100": 1032.78}  # sect. 6; the second for all 100 starts
NSGA_II_EVALUATIONS = 100 * 200  # individuals times generations, sect. 6
LARGEST_PAYLOAD = "12.65"  # [kg] sect. 6
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
