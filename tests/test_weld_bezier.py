"""The welding robot and its problem: pinocchio and plain geometry judge what the package builds and solves."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

from ocp_traj import problems
from ocp_traj.api.solving import solve
from ocp_traj.cli import sheets
from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.io.run_reader import load_run
from ocp_traj.paths.seam import Placement, TubeSeam
from ocp_traj.problems import kr90, weld_start
from ocp_traj.problems.weld_bezier import Ogbemhe2019, start
from ocp_traj.problems.weld_start import least_time
from ocp_traj.proof.audit import audit
from ocp_traj.results.solution import Solution
from ocp_traj.results.trajectory import Trajectory, trajectory_of
from ocp_traj.transcription.nlp import Status
from ocp_traj.transcription.symbolic import evaluate_objectives
from tests.independent.case import complete
from tests.independent.check import broken, excesses
from tests.independent.motion import Motion
from tests.independent.robots import WeldRobot
from tests.independent.weld import DEFAULTS
from tests.independent.weld import seam as independent_seam

# --- robot ---


def test_home_puts_the_flange_where_the_dimensions_say() -> None:
    """(0, -90, 90, 0, 0, 0) deg: 350 + 1400 + 215 mm out, 675 + 1350 - 41 mm up."""
    machine = WeldRobot(bare=True)
    machine.tip(np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]))
    flange = machine.data.oMi[6] * machine.flange
    assert_allclose(flange.translation, [1.965, 0.0, 1.984], atol=1e-12)
    assert_allclose(flange.rotation[:, 2], [1.0, 0.0, 0.0], atol=1e-12)


def test_the_wrist_lies_where_the_tip_says_and_never_beyond_its_reach() -> None:
    rng = np.random.default_rng(0)
    low, high = np.radians(kr90.POSITION)
    machine, longest = WeldRobot(riser=0.6), 0.0
    straight = np.zeros((2001, 6))
    straight[:, 1], straight[:, 2] = np.radians(-90.0), np.radians(np.linspace(-5.0, 5.0, 2001))
    for q in [*rng.uniform(low, high, (200, 6)), *straight]:
        pose = machine.tip(q)
        wrist = pose.translation + pose.rotation @ kr90.wrist_from_tip()
        other = q + np.array([0.0, 0.0, 0.0, 0.3, -0.7, 1.1])  # the wrist's joints do not move its centre
        moved = machine.tip(other)
        assert_allclose(moved.translation + moved.rotation @ kr90.wrist_from_tip(), wrist, atol=1e-12)
        out = np.array([np.cos(q[0]), -np.sin(q[0])]) @ wrist[:2] - kr90.ARM.a1
        longest = max(longest, float(np.hypot(out, wrist[2] - 0.6 - kr90.ARM.d1)))
    assert longest <= kr90.REACH + 1e-12
    assert longest == pytest.approx(kr90.REACH, rel=1e-6)


def test_inverse_kinematics_finds_random_postures_again() -> None:
    """500 within the ranges, by pinocchio's pose of the tip; joints 4 and 6 may be whole turns away."""
    machine, low, high = WeldRobot(riser=0.6), *np.radians(kr90.POSITION)
    q = np.random.default_rng(2).uniform(low, high, (500, 6))
    poses = [machine.tip(one).copy() for one in q]
    found = kr90.inverse_kinematics([p.rotation for p in poses], [p.translation for p in poses], riser=0.6)
    gap = np.abs(np.angle(np.exp(1j * (found - q[:, None])))).max(axis=2)
    assert np.nanmin(gap, axis=1).max() < 1e-9


def test_gravity_torques_of_the_bare_arm_stay_below_what_its_data_give() -> None:
    """Largest static torques without load: 6290 N m on A2, arm straight out, and 1367 on A3."""
    machine = WeldRobot(bare=True)
    low, high = np.radians(kr90.POSITION)
    rng = np.random.default_rng(1)
    found = np.max(
        [
            np.abs(pin.computeGeneralizedGravity(machine.model, machine.data, q))
            for q in rng.uniform(low, high, (4000, 6))
        ],
        0,
    )
    assert 6100.0 < found[1] <= 6290.0
    assert 1340.0 < found[2] <= 1367.5
    assert found[0] < 1e-9


# --- seam and start ---


@pytest.mark.slow
def test_the_fit_puts_the_torch_on_the_seam() -> None:
    case = Ogbemhe2019()
    begun = start(case)
    path = TubeSeam(0.15, 0.09, np.radians(60), (-np.pi / 2, np.pi / 2), Placement((2.05, 0.0, 1.0), np.pi))
    assert path.length == pytest.approx(0.3372, abs=5e-5)
    tags = path.at(np.linspace(0.0, path.length, 9))
    for state, place, axis in zip(begun.fit.states, tags.position, tags.axis, strict=True):
        pose = WeldRobot(riser=0.6).tip(state[0])
        assert np.linalg.norm(pose.translation - place) < 1e-4
        assert np.degrees(np.arccos(min(1.0, float(pose.rotation[:, 2] @ axis)))) < 1.0


def test_the_limits_up_to_snap_rule_a_move_from_rest_to_rest() -> None:
    """1, 10 and 60 deg of A3 alone: 622.533 d / T^4 <= 95 deg/s4 is the last to hold, (1.60, 2.84, 4.45) s."""
    for degrees in (1.0, 10.0, 60.0):
        a, b = np.zeros((5, 6)), np.zeros((5, 6))
        b[0, 2] = np.radians(degrees)
        found = least_time(a, b, Ogbemhe2019())
        exact = (622.533 * degrees / 95.0) ** 0.25
        assert exact <= found <= 1.03 * exact


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"origin": (4.0, 0.0, 1.0)}, r"tag \d of 9 is out of reach"),
        ({"case": "weld"}, "allowed are seam, air-move"),
        ({"rest_at_tags": True}, "for case air-move"),
        ({"tags": 1}, "give a whole number from 2 to 40"),
        ({"psi": 0.0}, "psi is 0.0 deg; give an angle above 0 and at most 90"),
        ({"weld_speed": 0.0}, "weld_speed is 0.0"),
        ({"home": (0.0, -90.0, 100.0, 0.0, -60.0, 360.0)}, "home has A6 at 360.0 deg"),
        ({"seam_file": "nowhere.csv"}, "cannot read the seam file nowhere.csv: No such file"),
        ({"tags": 2, "phi": (-180.0, 180.0)}, "give more tags"),
    ],
)
def test_what_cannot_be_welded_is_refused_with_the_reason(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        problems.load("weld-bezier", **changes)


@pytest.mark.slow
def test_a_singular_tag_is_named_with_its_value(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weld_start, "SINGULAR", 0.5)
    with pytest.raises(InputError, match=r"tag \d of 9 is singular: .* its Jacobian is 0\.\d+, 0\.5 or more is needed"):
        start(Ogbemhe2019(riser=0.61))  # not one that is remembered


# --- populations: all individuals begin at the one start of a seam, and small ones stay there ---


@pytest.mark.slow
@pytest.mark.parametrize("method", ["nsga2", "mopso"])
def test_populations_walk_along_the_seam(method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sizes = ["--option", "population=8", "--option", "generations=2"]
    run_folder = tmp_path / "run"
    command = ["pareto", "weld-bezier", "--objectives", "air_time,movement", "--method", method, *sizes]
    assert run([*command, "-o", str(run_folder)]) == 0
    said = capsys.readouterr()
    saved = json.loads((run_folder / "run.json").read_text())
    assert saved["points"] >= 1 and saved["info"]["moved"] and saved["info"]["legs"] == 1
    measured = saved["hypervolume"]
    assert measured["ideal_from"] == "problem" and not measured["own_ideal"]
    assert measured["ideal"] == problems.load("weld-bezier").ideal_point(["air_time", "movement"])
    assert 0.2 < measured["value"] < 0.9 and "not comparable" not in said.out


@pytest.mark.slow
def test_the_hybrid_keeps_the_ends_it_found_and_says_whether_more_came_of_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sizes = ["--option", "population=8", "--option", "generations=2", "--points", "2"]
    command = ["pareto", "weld-bezier", "--objectives", "air_time,movement", "--method", "hmoga", *sizes]
    code = run([*command, "-o", str(tmp_path / "run")])
    saved = json.loads((tmp_path / "run" / "run.json").read_text())
    front = load_run(tmp_path / "run")
    assert all(front.audit(i).proved and kept(front.trajectory(i)) for i in range(len(front)))
    assert code == (0 if saved["info"]["moved"] else 1)
    assert ("hmoga found nothing better" in capsys.readouterr().err) == (not saved["info"]["moved"])
    assert saved["points"] >= 2 and saved["hypervolume"]["ideal_from"] == "problem"
    assert saved["info"]["ideal"]["air_time"] == pytest.approx(saved["hypervolume"]["ideal"]["air_time"], rel=1e-2)


# --- on the screen ---


@pytest.mark.slow
def test_hundreds_of_variables_stay_off_the_screen_but_not_out_of_the_json() -> None:
    problem = problems.load("weld-bezier", case="air-move")
    many = problems.load("weld-bezier")
    for one, left in ((problem, 0), (many, 270)):
        x = one.guess(np.random.default_rng(0))
        found = Solution(one.id, x, 0.0, Status.SOLVED, 0.0, 1, 0.0, trajectory=trajectory_of(one, x))
        found = replace(found, audit=audit(found.trajectory, one.requirements), objectives=evaluate_objectives(one, x))
        sheet = sheets.solution_sheet(one, found)
        (table,) = [t for t in sheet.tables if t[0].startswith("Variables")]
        assert len(table[2]) == one.size - left
        assert sum(len(block) for block in sheet.data["variables"].values()) == one.size
        assert (str(left) in table[0]) == bool(left)


# --- solutions ---


def kept(motion: Trajectory | None) -> bool:
    """Whether every limit is kept, recomputed."""
    return motion is not None and not broken(excesses(motion.to_dict()))


@pytest.mark.slow
@pytest.mark.parametrize(("rest", "seconds"), [(False, 4.23), (True, 7.06)])
def test_the_quickest_air_move(rest: bool, seconds: float) -> None:
    problem = problems.load("weld-bezier", case="air-move", rest_at_tags=rest)
    solution = solve(problem, objective="air_time").require()
    assert solution.audit is not None and solution.audit.proved
    assert solution.objectives["air_time"] == pytest.approx(seconds, rel=0.01)
    assert kept(solution.trajectory)


def root_mean_square(motion: Trajectory) -> float:
    """Distance of the torch's tip from the seam itself at 50 instants a piece, root mean square [m]."""
    data = motion.to_dict()
    case, curve = complete(data, DEFAULTS), Motion.read(data)
    machine, path, u = WeldRobot(case["payload"], case["riser"]), independent_seam(case), np.linspace(0.0, 1.0, 51)
    off = []
    for k in range(1, case["tags"]):
        wanted, _ = path.at(path.length * (k - 1 + u) / (case["tags"] - 1))
        off.append(((machine.tips(curve.at(k, u))[0] - wanted) ** 2).sum(axis=1))
    return float(np.sqrt(np.mean(off)))


SEAMS: list[tuple[dict[str, Any], str, float, float]] = [
    # changes, objective, largest air time [s], largest rms [mm]
    ({}, "total", 7.5, 0.03),
]


@pytest.mark.slow
@pytest.mark.parametrize(("changes", "objective", "seconds", "rms"), SEAMS, ids=str)
def test_a_seam_is_welded_within_every_limit(
    changes: dict[str, Any], objective: str, seconds: float, rms: float
) -> None:
    problem = problems.load("weld-bezier", **changes)
    solution = solve(problem, objective=objective).require()
    motion = solution.trajectory
    assert motion is not None and kept(motion)
    off = root_mean_square(motion)
    assert 1e3 * off <= rms
    assert solution.audit is not None and solution.audit.proved
    assert solution.objectives["air_time"] <= seconds
    assert problem.about.figures is not None
    figures = {name: value for name, value, _ in problem.about.figures(motion)}
    assert figures["tip off the seam, rms"] == pytest.approx(1e3 * off, rel=0.05)
