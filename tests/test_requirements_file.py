import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from pytest import approx
from scipy.interpolate import CubicSpline

from ocp_traj import problems
from ocp_traj.cli.commands import run
from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.errors import FileFormatError, InputError
from ocp_traj.formulation.problem import Problem
from ocp_traj.io.requirements_file import read_requirements
from ocp_traj.proof.audit import audit
from ocp_traj.proof.verdicts import CHECKED, UNDECIDED, VIOLATED, AuditRow
from ocp_traj.results.trajectory import Trajectory, trajectory_of

ROOT = Path(__file__).resolve().parent.parent
FOREIGN = ROOT / "examples" / "foreign"
URDF = f"[robot]\nurdf = {json.dumps(str(FOREIGN / 'arm.urdf'))}\n"
JOINTS = '["A1", "A2", "A3"]'
HEAD = f'format = "ocp-traj/limits/1"\njoints = {JOINTS}\nunits = ["rad", "rad", "rad"]\n'
VELOCITY = "[velocity]\nlimit = [2.0, 1.5, 2.0]\n"
EFFORT = "[effort]\nlimit = [60, 60, 25]\n"


def write(folder: Path, text: str) -> Path:
    path = folder / "limits.toml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def foreign() -> Trajectory:
    return Trajectory.load(FOREIGN / "samples.json")


# --- the examples ---


def test_the_foreign_example_is_proved(foreign: Trajectory) -> None:
    requirements = read_requirements(FOREIGN / "limits.toml")
    checked = audit(foreign, requirements)
    assert checked.proved
    paths = ["position-limit", "velocity-limit", "acceleration-limit", "jerk-limit", "effort-limit", "tool-box"]
    points = ["rest", "continuity of q", "continuity of v", "continuity of a"]
    assert [row.limit for row in checked.rows] == [limit for limit in (*paths, *points) for _ in range(3)]
    assert {row.label for row in checked.rows if row.limit == "effort-limit"} == {"tau_A1", "tau_A2", "tau_A3"}


def test_the_tight_limits_are_violated_where_they_say(foreign: Trajectory) -> None:
    checked = audit(foreign, read_requirements(FOREIGN / "limits_tight.toml"))
    assert checked.verdict == VIOLATED
    assert {(row.limit, row.label) for row in checked.failures} == {("effort-limit", "tau_A2"), ("tool-box", "z")}


# --- against other ways to the same numbers ---


def test_effort_and_tool_equal_pinocchio_on_dense_samples(foreign: Trajectory) -> None:
    model = pin.buildModelFromUrdf(str(FOREIGN / "arm.urdf"))
    flange = model.getFrameId("flange")
    model.appendBodyToJoint(3, pin.Inertia(2.0, np.zeros(3), np.zeros((3, 3))), model.frames[flange].placement)
    data = model.createData()

    def values(times: Any) -> Any:
        """Efforts and tool point, ``(N, 6)``."""
        rows = []
        for q, v, a in zip(*(foreign.curve(times, order) for order in range(3)), strict=True):
            effort = pin.rnea(model, data, q, v, a).copy()
            pin.framesForwardKinematics(model, data, q)
            rows.append([*effort, *data.oMf[flange].translation])
        return np.array(rows)

    checked = audit(foreign, read_requirements(FOREIGN / "limits.toml"), tightness=1e-7)
    rows = [row for row in checked.rows if row.limit in ("effort-limit", "tool-box")]
    dense = values(np.linspace(0.0, foreign.duration, 8001))
    missed = np.abs(np.diff(dense, 2, axis=0)).max(axis=0)  # a peak between samples is higher by an eighth of this
    scale = np.array([60.0, 60.0, 25.0, 1.0, 0.8, 0.5])  # half the ranges of the limits
    for k, row in enumerate(rows):
        sign = 1.0 if row.bound > row.attained else -1.0
        extreme = (sign * dense[:, k]).max()
        assert row.attained == approx(values([row.instant])[0, k], rel=1e-9, abs=1e-9)
        assert extreme <= sign * row.proved_bound + 1e-9
        assert sign * row.proved_bound <= extreme + missed[k] + 2e-7 * scale[k], row


def hybrid_toml() -> str:
    limits = problems.module("hybrid-spline").LIMITS
    joints = problems.module("hybrid-spline").JOINTS
    tables = []
    for name in ("position", "velocity", "acceleration", "jerk", "effort"):
        lower, upper = limits.bounds(name)
        tables.append(f"[{name}]\nlower = {lower.tolist()}\nupper = {upper.tolist()}\n")
    return (
        f'format = "ocp-traj/limits/1"\njoints = {json.dumps(joints)}\n'
        'units = ["m", "m", "m", "rad", "rad"]\ncontinuity = 2\n'
        + "".join(tables)
        + '[robot]\nproblem = "hybrid-spline"\n[payload]\nparameter = true\n[rest]\norder = 2\n'
    )


@pytest.fixture(scope="module")
def table_7(hybrid: Problem) -> Trajectory:
    return trajectory_of(hybrid, problems.module("hybrid-spline").TABLE_7)


def unlabelled(rows: tuple[AuditRow, ...], leave_out: tuple[str, ...] = ()) -> list[AuditRow]:
    kept = [row for row in rows if row.limit not in leave_out]
    return [replace(row, label="") if row.limit == "effort-limit" else row for row in kept]


def test_the_hybrid_splines_limits_give_the_audit_of_its_problem(
    hybrid: Problem, table_7: Trajectory, tmp_path: Path
) -> None:
    requirements = read_requirements(write(tmp_path, hybrid_toml()))
    ours, theirs = audit(table_7, requirements), audit(table_7, hybrid.requirements)
    assert unlabelled(ours.rows, ("parameter",)) == unlabelled(theirs.rows, ("yaw", "via"))
    force = [row.label for row in ours.rows if row.limit == "effort-limit"]
    assert force == ["F_X_S1", "F_X_S2", "F_X_S3", "tau_phi_4", "tau_phi_5"]


def test_a_robots_own_limits_are_those_of_its_problem(table_7: Trajectory, tmp_path: Path) -> None:
    head, robot = hybrid_toml().split("[position]")[0], '[robot]\nproblem = "hybrid-spline"\nlimits = true\n'
    own = read_requirements(write(tmp_path, head + robot + hybrid_toml().split('"hybrid-spline"\n')[1]))
    written = read_requirements(write(tmp_path, hybrid_toml()))
    assert audit(table_7, own).rows == audit(table_7, written).rows


def test_a_payload_of_fixed_mass_is_the_parameter_of_that_value(table_7: Trajectory, tmp_path: Path) -> None:
    free = read_requirements(write(tmp_path, hybrid_toml()))
    fixed = read_requirements(write(tmp_path, hybrid_toml().replace("parameter = true", "mass = 10")))
    assert (free.parameters, fixed.parameters) == (("payload",), ())
    rows = audit(table_7, free).rows
    (payload,) = (row for row in rows if row.limit == "parameter")
    assert (payload.bound, payload.attained, payload.unit, payload.verdict) == (0.0, 10.0, "kg", CHECKED)
    pairs = zip((row for row in rows if row is not payload), audit(table_7, fixed).rows, strict=True)
    assert all(a.attained == approx(b.attained, rel=1e-9, abs=1e-9) and a.verdict == b.verdict for a, b in pairs)
    with pytest.raises(InputError, match=r"need the parameters \['payload'\]"):
        audit(replace(table_7, parameters={}), free)
    lifted = audit(replace(table_7, parameters={"payload": -5.0}), free)
    assert [(row.limit, row.label) for row in lifted.failures] == [("parameter", "payload")]


def test_samples_splines_and_control_points_of_one_motion_give_one_audit(tmp_path: Path) -> None:
    samples = json.loads((FOREIGN / "samples.json").read_text())
    spline = CubicSpline(samples["times"], samples["positions"], bc_type="clamped")
    coefficients = [spline.c[::-1, k].tolist() for k in range(len(samples["times"]) - 1)]  # ascending powers
    powers = {"format": "ocp-traj/spline/1", "joints": samples["joints"], "knots": samples["times"]}
    (tmp_path / "spline.json").write_text(json.dumps({**powers, "coefficients": coefficients}))
    requirements = read_requirements(FOREIGN / "limits.toml")
    from_samples = Trajectory.load(FOREIGN / "samples.json")
    from_points = Trajectory.load(from_samples.save(tmp_path / "points.json"))
    expected = audit(from_samples, requirements)
    assert audit(from_points, requirements).rows == expected.rows
    found = audit(Trajectory.load(tmp_path / "spline.json"), requirements)
    for row, other in zip(found.rows, expected.rows, strict=True):
        assert (row.limit, row.label, row.verdict) == (other.limit, other.label, other.verdict)
        # The conversion rounds by 1e-16, divided by the cube of 0.1 s in the jerk; a jump is nothing but rounding.
        assert row.attained == approx(other.attained, rel=1e-9, abs=1e-11)
        if row.verdict != CHECKED:
            assert row.proved_bound == approx(other.proved_bound, rel=1e-9, abs=1e-11)


# --- what is read ---


def test_a_limit_is_symmetric_and_infinite_entries_are_none(tmp_path: Path) -> None:
    text = HEAD + "[velocity]\nlimit = [2.0, inf, 3]\n[snap]\nlower = [-1, -inf, -3.0]\nupper = [1, 5, inf]\n"
    velocity, snap = read_requirements(write(tmp_path, text)).path_constraints
    assert (velocity.id, velocity.order, velocity.units) == ("velocity-limit", 1, ("rad/s",) * 3)
    assert velocity.lower.tolist() == [-2.0, -np.inf, -3.0] and velocity.upper.tolist() == [2.0, np.inf, 3.0]
    assert (snap.id, snap.order, snap.units) == ("snap-limit", 4, ("rad/s4",) * 3)
    assert snap.lower.tolist() == [-1.0, -np.inf, -3.0] and snap.upper.tolist() == [1.0, 5.0, np.inf]


def test_nothing_is_checked_that_is_not_asked_for(tmp_path: Path) -> None:
    requirements = read_requirements(write(tmp_path, HEAD + VELOCITY + URDF))
    assert [limit.id for limit in requirements.path_constraints] == ["velocity-limit"]
    assert requirements.point_constraints == () and requirements.parameters == () and requirements.continuity == 0


def test_the_urdfs_limits_fill_in_only_where_asked(tmp_path: Path) -> None:
    requirements = read_requirements(write(tmp_path, HEAD + VELOCITY + URDF + "limits = true\n"))
    limits = {limit.id: limit for limit in requirements.path_constraints}
    assert list(limits) == ["position-limit", "velocity-limit", "effort-limit"]
    assert limits["position-limit"].upper.tolist() == [2.9, 1.6, 2.2]
    assert limits["velocity-limit"].upper.tolist() == [2.0, 1.5, 2.0]  # the file's, not the URDF's 2.5, 2, 3
    assert limits["effort-limit"].lower.tolist() == [-60.0, -60.0, -25.0]


def test_limits_of_a_urdf_that_are_unsound_matter_only_where_asked_for(tmp_path: Path) -> None:
    (tmp_path / "zero.urdf").write_text((FOREIGN / "arm.urdf").read_text().replace('effort="25"', 'effort="0"'))
    robot = '[robot]\nurdf = "zero.urdf"\n'
    assert len(read_requirements(write(tmp_path, HEAD + EFFORT + robot)).path_constraints) == 1
    assert len(read_requirements(write(tmp_path, HEAD + EFFORT + robot + "limits = true")).path_constraints) == 3
    message = r"\[robot\] urdf: .*effort limit of 'A3' is 0.*give that table in this file"
    with pytest.raises(FileFormatError, match=message):
        read_requirements(write(tmp_path, HEAD + VELOCITY + robot + "limits = true"))


@pytest.mark.parametrize(
    ("lines", "expected"), [("", [0.0, 0.0, -9.81]), ("gravity = [0, -1.62, 0]", [0.0, -1.62, 0.0])]
)
def test_gravity_is_the_files_or_the_earths(lines: str, expected: list[float], tmp_path: Path) -> None:
    still = Trajectory.from_dict(
        {
            "format": "ocp-traj/spline/1",
            "joints": ["A1", "A2", "A3"],
            "knots": [0, 1],
            "coefficients": [[[0.1, 0.5, -0.2]]],
        }
    )
    rows = audit(still, read_requirements(write(tmp_path, HEAD + EFFORT + URDF + lines))).rows
    model = pin.buildModelFromUrdf(str(FOREIGN / "arm.urdf"))
    model.gravity.linear = np.array(expected)
    tau = pin.computeGeneralizedGravity(model, model.createData(), np.array([0.1, 0.5, -0.2]))
    assert [row.attained for row in rows] == approx(tau.tolist(), abs=1e-9)


def test_rest_is_checked_up_to_its_order_at_both_ends(foreign: Trajectory, tmp_path: Path) -> None:
    checked = audit(foreign, read_requirements(write(tmp_path, HEAD + "[rest]\norder = 2\n")))
    assert [(row.label, row.unit) for row in checked.rows if row.limit == "rest"] == [
        (f"{name} A{i}", unit) for name, unit in (("v", "rad/s"), ("a", "rad/s2")) for i in (1, 2, 3)
    ]
    assert {row.label: row.verdict for row in checked.rows}["v A1"] == CHECKED
    assert {row.label: row.verdict for row in checked.rows}["a A1"] == VIOLATED  # a clamped spline rests in v alone
    loose = audit(foreign, read_requirements(write(tmp_path, HEAD + "[rest]\norder = 2\ntolerance = 1\n")))
    assert loose.proved


@pytest.mark.parametrize(("name", "least"), [("position", 0), ("velocity", 0), ("acceleration", 1), ("snap", 3)])
def test_a_limit_on_a_derivative_asks_for_the_one_below_it_to_be_continuous(
    tmp_path: Path, name: str, least: int
) -> None:
    text = HEAD + f"[{name}]\nlower = [-1, -1, -1]\nupper = [1, 1, 1]\n"
    assert read_requirements(write(tmp_path, text)).continuity == least
    asked = text.replace("[" + name, "continuity = 2\n[" + name)
    assert read_requirements(write(tmp_path, asked)).continuity == 2


def test_a_jump_is_found(tmp_path: Path) -> None:
    jumping: dict[str, Any] = {"format": "ocp-traj/spline/1", "joints": ["A1", "A2", "A3"], "knots": [0.0, 1.0, 2.0]}
    stairs = Trajectory.from_dict({**jumping, "coefficients": [[[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]]]})
    found = audit(stairs, read_requirements(write(tmp_path, HEAD + VELOCITY)))
    assert [(row.limit, row.label) for row in found.failures] == [("continuity of q", "A1")]


# --- what is refused ---


def test_joints_must_be_those_of_the_limits_in_order(foreign: Trajectory, tmp_path: Path) -> None:
    requirements = read_requirements(write(tmp_path, HEAD + VELOCITY))
    assert audit(foreign, requirements).proved
    swapped = replace(foreign, joints=("A2", "A1", "A3"))
    message = (
        r"joints are \['A2', 'A1', 'A3'\], those of the limits \['A1', 'A2', 'A3'\]; give the same, in the same order"
    )
    with pytest.raises(InputError, match=message):
        audit(swapped, requirements)


UNITS = 'units = ["rad", "rad", "rad"]'
BAD_FILES = [
    ("joints = [", r"is not a limits file: not TOML \("),
    ("a = " + 5000 * "[", "is not a limits file: nested too deep"),
    ("", "is not a limits file: its format is None; allowed is 'ocp-traj/limits/1'"),
    ('format = "ocp-traj/limits/2"', "its format is 'ocp-traj/limits/2'; allowed is"),
    ('format = ["ocp-traj/limits/1"]', "its format is "),
    ('format = "ocp-traj/limits/1"', "joints is missing; give a list of different names"),
    (HEAD.replace(JOINTS, '"A1"'), "joints is 'A1'; give a list of different names"),
    (HEAD.replace(JOINTS, "[]"), r"joints is \[\]; give a list of different names"),
    (HEAD.replace(JOINTS, "[1, 2, 3]"), r"joints is \[1, 2, 3\]; give a list"),
    (HEAD.replace("A2", "A1"), r"joints is \['A1', 'A1', 'A3'\]; give a list of different names"),
    (HEAD.replace(UNITS, ""), 'units is missing; give "rad" or "m" for each of'),
    (HEAD.replace('"rad"]', '"deg"]'), r"units is \['rad', 'rad', 'deg'\]; give .*SI only, no degrees"),
    (HEAD.replace(UNITS, 'units = ["rad"]'), r"units is \['rad'\]; give .* for each of \['A1', 'A2', 'A3'\]"),
    (HEAD.replace(UNITS, "units = [[1], 2, 3]"), r"units is \[\[1\], 2, 3\]; give "),
    (HEAD, "limits nothing; give at least one finite limit"),
    (HEAD + "[velocity]\nlimit = [inf, inf, inf]", "limits nothing; give at least one finite limit"),
    (HEAD + "[velocty]\nlimit = [1, 1, 1]", "velocty is not allowed here; allowed are .*velocity, .*effort, .*robot"),
    (HEAD + "continuity = 5", "continuity is 5; give a whole number from 0 to 4"),
    (HEAD + "continuity = true", "continuity is True; give a whole number from 0 to 4"),
    (HEAD + "continuity = 2.0", "continuity is 2.0; give a whole number from 0 to 4"),
    (HEAD + "velocity = [1, 1, 1]", r"velocity is \[1, 1, 1\]; give a table, \[velocity\]"),
    (HEAD + "[velocity]", r"\[velocity\] is empty; give lower, upper, limit, or leave it out"),
    (HEAD + "[velocity]\nmax = [1, 1, 1]", r"\[velocity\] max is not allowed here; allowed are lower, upper, limit"),
    (HEAD + "[velocity]\nlimit_deg = [1, 1, 1]", r"\[velocity\] limit_deg is not allowed here; .*no degrees"),
    (HEAD + "[velocity]\nlimit = 2.0", r"\[velocity\] limit is 2.0; give 3 numbers.*, one for each of \['A1'"),
    (HEAD + "[velocity]\nlimit = [1, 1]", r"\[velocity\] limit is \[1, 1\]; give 3 numbers"),
    (HEAD + '[velocity]\nlimit = [1, 1, "90 deg"]', r"limit is \[1, 1, '90 deg'\]; give 3 numbers.*no degrees"),
    (HEAD + "[velocity]\nlimit = [1, 1, true]", r"limit is \[1, 1, True\]; give 3 numbers"),
    (HEAD + "[velocity]\nlimit = [1, 1, nan]", r"limit is \[1, 1, nan\]; give 3 numbers"),
    (HEAD + f"[velocity]\nlimit = [1, 1, 1{'0' * 400}]", r"limit is \[1, 1, 10* \.\. 0*\] \(409 characters\); give"),
    (HEAD + "[velocity]\nlimit = [1, 1, 1e300]", r"limit is \[1, 1, 1e\+300\]; give 3 numbers below 1e\+300"),
    (HEAD + "[velocity]\nlimit = [1, 1, 1e400]", r"limit is \[1, 1, nan\]; give 3 numbers below 1e\+300"),
    (HEAD + "[velocity]\nlimit = [1, 0, 1]", r"\[velocity\] A2 has lower -?0 and upper 0; give .* a limit > 0"),
    (HEAD + "[velocity]\nlimit = [1, -2, 1]", r"\[velocity\] A2 has lower 2 and upper -2; give lower < upper"),
    (HEAD + "[velocity]\nlower = [-1, -1, -1]", r"\[velocity\] upper is missing; give 3 numbers"),
    (HEAD + "[velocity]\nupper = [1, 1, 1]", r"\[velocity\] lower is missing; give 3 numbers"),
    (HEAD + "[velocity]\nlimit = [1, 1, 1]\nupper = [1, 1, 1]", r"\[velocity\] upper is not allowed here; .*limit"),
    (HEAD + "[position]\nlower = [-1, 2, -1]\nupper = [1, 2, 1]", r"\[position\] A2 has lower 2 and upper 2; give"),
    (HEAD + EFFORT, r"\[effort\] needs the robot; give \[robot\] with urdf, description or problem"),
    (HEAD + "[tool]\nlower = [0, 0, 0]", r"\[tool\] needs the robot; give \[robot\] with urdf, description or problem"),
    (HEAD + URDF + "[tool]\nlimit = [1, 1, 1]", r"\[tool\] limit is not allowed here; allowed are lower, upper"),
    (HEAD + URDF + "[tool]\nlower = [0, 0]", r"lower is \[0, 0\]; give 3 numbers.*, x, y, z \[m\] in the world"),
    (HEAD + URDF + "[tool]\nlower = [0, 0, 2]\nupper = [1, 1, 1]", r"\[tool\] z has lower 2 and upper 1; give"),
    (HEAD + VELOCITY + "[payload]\nmass = 2", r"\[payload\] changes nothing .*; give \[effort\] too"),
    (HEAD + EFFORT + URDF + "[payload]\nmass = -1", r"\[payload\] mass is -1; give a mass \[kg\], 0 or more"),
    (HEAD + EFFORT + URDF + "[payload]\nmass = inf", r"\[payload\] mass is inf; give a mass"),
    (HEAD + EFFORT + URDF + '[payload]\nmass = "2 kg"', r"\[payload\] mass is '2 kg'; give a mass"),
    (HEAD + EFFORT + URDF + "[payload]\nparameter = false", r"\[payload\] parameter is False; give true, or"),
    (HEAD + EFFORT + URDF + "[payload]\nparameter = true\nmass = 1", r"\[payload\] mass is not allowed here"),
    (HEAD + "[rest]\ntolerance = 1e-6", r"\[rest\] order is missing; give 1 to 4, the highest derivative"),
    (HEAD + "[rest]\norder = 0", r"\[rest\] order is 0; give 1 to 4"),
    (HEAD + "[rest]\norder = 5", r"\[rest\] order is 5; give 1 to 4"),
    (HEAD + "[rest]\norder = 1\ntolerance = 0", r"\[rest\] tolerance is 0; give a number > 0"),
    (HEAD + "[robot]\ngravity = [0, 0, 0]", r"\[robot\] urdf is missing; give the path of a URDF file.*or problem"),
    (HEAD + "[robot]\nurdf = 3", r"\[robot\] urdf is 3; give the path of a URDF file"),
    (HEAD + '[robot]\nurdf = "none.urdf"', r"\[robot\] urdf: cannot read the URDF file .*none.urdf: No such file"),
    (HEAD + '[robot]\nurdf = "limits.toml"', r"\[robot\] urdf: '.*limits.toml' is not a URDF: it is not XML"),
    (HEAD + URDF + 'tool_frame = "hand"', r"\[robot\] urdf: 'hand' is no frame that moves in .*; those are .*flange"),
    (HEAD + URDF + "tool_frame = 3", r"\[robot\] tool_frame is 3; give the name of a link or frame"),
    (HEAD + URDF + "gravity = 9.81", r"\[robot\] gravity is 9.81; give 3 numbers.*, x, y, z \[m/s2\] in the world"),
    (HEAD + URDF + "gravity = [0, 0, inf]", r"\[robot\] urdf: gravity is .*, expected three finite numbers"),
    (HEAD + URDF + 'limits = "yes"', r"\[robot\] limits is 'yes'; give true or false"),
    (HEAD + URDF + 'problem = "hybrid-spline"', r"\[robot\] urdf is not allowed here; allowed are problem, limits"),
    (HEAD + '[robot]\nproblem = "none"', r"\[robot\] problem is 'none'; give one of hybrid-spline"),
    (HEAD + '[robot]\nproblem = "hybrid-spline"', r"\[robot\] has the joints {'X_S1': 'm', .*this file {'A1': 'rad', "),
    (HEAD.replace(JOINTS, '["A1", "A3", "A2"]') + URDF, r"has the joints {'A1': .*'A2': .*this file {'A1': .*'A3'"),
    (HEAD.replace('"rad"]', '"m"]') + URDF, r"has the joints {.*'A3': 'rad'}, this file {.*'A3': 'm'}; give the same"),
    (HEAD.replace(JOINTS, '["A1", "A2"]').replace('"rad"]', "]") + URDF, r"has the joints {'A1': .*'A3'"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "message"), BAD_FILES)
def test_a_file_that_is_not_sound_is_refused_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    path = write(tmp_path, text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_requirements(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_files_that_cannot_be_read_say_why(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="cannot read the limits file .*No such file"):
        read_requirements(tmp_path / "none.toml")
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(FileFormatError, match="it is not text"):
        read_requirements(tmp_path / "picture.toml")


# --- the documentation ---


def test_the_examples_of_the_documentation_are_read(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "formats.md").read_text()
    blocks = [part.split("\n```")[0].split("\n", 1) for part in text.split("\n```")[1::2]]
    trajectories = [json.loads(body) for kind, body in blocks if kind == "json" and "/run/" not in body]
    assert [data["format"].split("/")[1] for data in trajectories] == ["trajectory", "samples", "spline"]
    motions = [Trajectory.from_dict(data) for data in trajectories]
    (limits,) = (body for kind, body in blocks if kind == "toml")
    (tmp_path / "robot.urdf").write_text((FOREIGN / "arm.urdf").read_text())
    requirements = read_requirements(write(tmp_path, limits))
    for motion in motions:
        assert audit(motion, requirements).proved, audit(motion, requirements).explain()


def test_masses_beyond_what_the_dynamics_round_are_refused(tmp_path: Path) -> None:
    text = (FOREIGN / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(re.sub(r'<mass value="[^"]*"', '<mass value="1e12"', text, count=1))
    (tmp_path / "limits.toml").write_text((FOREIGN / "limits.toml").read_text())
    with pytest.raises(FileFormatError, match=r"\[effort\] cannot be proved for masses of 1e\+12 kg in all: rounding"):
        read_requirements(tmp_path / "limits.toml")


def test_limits_that_ask_nothing_of_a_trajectory_prove_nothing(foreign: Trajectory, tmp_path: Path) -> None:
    path = write(tmp_path, HEAD + "continuity = 3")
    one = replace(foreign, curve=PiecewiseBezier(foreign.curve.durations[:1], foreign.curve.control_points[:1]))
    assert audit(one, read_requirements(path)).verdict == UNDECIDED
    assert run(["audit", str(one.save(tmp_path / "one.json")), "--limits", str(path)]) == 2


def test_an_effort_of_a_robot_without_inertias_is_refused(tmp_path: Path) -> None:
    folder = Path(__file__).parent.parent / "examples" / "foreign"
    bare = re.sub(r"<inertial>.*?</inertial>", "", (folder / "arm.urdf").read_text(), flags=re.S)
    (tmp_path / "arm.urdf").write_text(bare)
    (tmp_path / "limits.toml").write_text((folder / "limits.toml").read_text())
    with pytest.raises(FileFormatError, match="without inertia beyond A"):
        read_requirements(tmp_path / "limits.toml")
