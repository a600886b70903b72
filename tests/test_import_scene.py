import copy
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml

from ocp_traj.cli.commands import run
from ocp_traj.errors import InputError
from ocp_traj.formulation.collision_resolution import bodies_of
from ocp_traj.formulation.task_file import read_task
from ocp_traj.formulation.task_resolution import resolve
from ocp_traj.io.import_scene import import_scene
from ocp_traj.robot.numbers import from_numbers

URDF = """<robot name="arm">
  <link name="base"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0.3 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="lower"><collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <link name="finger"/><link name="plate"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="20"/></joint>
  <joint name="grip" type="prismatic"><parent link="lower"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" velocity="1" effort="5"/></joint>
  <joint name="plate_joint" type="fixed"><parent link="lower"/><child link="plate"/><origin xyz="0.3 0 0"/></joint>
</robot>"""
SRDF = '<robot name="arm"><disable_collisions link1="base" link2="lower" reason="Never"/></robot>'
HALF = float(np.sqrt(0.5))
SCENE: dict[str, Any] = {
    "name": "",
    "robot_model_name": "arm",
    "robot_state": {
        "joint_state": {"name": ["a", "b", "grip"], "position": [0.0, 0.0, 0.01]},
        "attached_collision_objects": [
            {
                "link_name": "plate",
                "touch_links": ["lower", "plate"],
                "object": {
                    "id": "part",
                    "primitives": [{"type": "cylinder", "dimensions": [0.1, 0.02]}],
                    "primitive_poses": [{"position": [0.0, 0.0, 0.05]}],
                },
            }
        ],
    },
    "fixed_frame_transforms": [
        {"child_frame_id": "world", "transform": {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1]}}
    ],
    "allowed_collision_matrix": {"entry_names": ["a", "wall"], "entry_values": [[True, False], [False, False]]},
    "world": {
        "collision_objects": [
            {
                "id": "wall",
                "pose": {"position": [1.0, 0.0, 0.5], "orientation": [0.0, 0.0, HALF, HALF]},
                "primitives": [{"type": "box", "dimensions": [0.2, 0.1, 0.4]}],
                "primitive_poses": [
                    {"position": [0.1, 0.0, 0.0], "orientation": {"x": HALF, "y": 0, "z": 0, "w": HALF}}
                ],
            },
            {
                "id": "posts",
                "header": {"frame_id": "world"},
                "primitives": [{"type": 3, "dimensions": [0.6, 0.05]}, {"type": "sphere", "dimensions": [0.1]}],
                "primitive_poses": [
                    {"position": [0.0, 1.0, 0.3], "orientation": [0, HALF, 0, HALF]},
                    {"position": {"x": 0.0, "y": -1.0, "z": 0.0}},
                ],
                "operation": 0,
            },
        ],
        "octomap": {"header": {"frame_id": ""}, "octomap": {"data": []}},
    },
}
REQUEST: dict[str, Any] = {
    "group_name": "arm",
    "start_state": {"joint_state": {"name": ["b", "a", "grip"], "position": [0.1, -1.0, 0.02]}},
    "goal_constraints": [
        {
            "joint_constraints": [
                {"joint_name": "b", "position": -0.5, "tolerance_above": 0.01, "tolerance_below": 0.01, "weight": 1},
                {"joint_name": "a", "position": 1.25},
            ]
        }
    ],
    "max_velocity_scaling_factor": 0.5,
    "max_acceleration_scaling_factor": 0,
    "path_constraints": {"joint_constraints": []},
}
LIMITS = {"limits.acceleration": "8", "limits.jerk": "60"}


def written(tmp_path: Path, scene: Any = SCENE, request: Any = REQUEST) -> tuple[Path, Path]:
    (tmp_path / "arm.urdf").write_text(URDF)
    (tmp_path / "arm.srdf").write_text(SRDF)
    files = tmp_path / "scene.yaml", tmp_path / "request.yaml"
    for file, data in zip(files, (scene, request), strict=True):
        file.write_text(data if isinstance(data, str) else yaml.safe_dump(data))
    return files


def imported(tmp_path: Path, changes: dict[str, str] = LIMITS, **given: Any) -> dict[str, Any]:
    files = written(tmp_path, **given)
    made = import_scene(
        *files, tmp_path / "task.toml", urdf=tmp_path / "arm.urdf", srdf=tmp_path / "arm.srdf", changes=changes
    )
    (tmp_path / "task.toml").write_text(made.text)
    return tomllib.loads(made.text)


def test_bodies_and_ends_are_those_of_the_files(tmp_path: Path) -> None:
    task = imported(tmp_path)
    assert task["move"] == [{"start": [-1.0, 0.1], "goal": [1.25, -0.5]}]
    assert task["robot"] == {"urdf": "arm.urdf", "locked": {"grip": 0.02}}
    assert task["limits"] == {"acceleration": 8, "jerk": 60, "velocity": "50 %"}
    resolved = resolve(read_task(tmp_path / "task.toml"), tmp_path)
    assert resolved.collision is not None
    robot = from_numbers(resolved.robot.numbers)
    bodies = {body.name: body for body in bodies_of(resolved.collision, robot)}
    # The wall by hand: its pose turns x to y, its primitive's turns y to z.
    wall = bodies["wall"]
    placement = pin.SE3(pin.utils.rotate("z", np.pi / 2), np.array([1.0, 0.0, 0.5])) * pin.SE3(
        pin.utils.rotate("x", np.pi / 2), np.array([0.1, 0.0, 0.0])
    )
    corners = {tuple(np.round(v, 9)) for v in wall.vertices}
    signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T
    wanted = {tuple(np.round(placement.act(s * [0.2, 0.1, 0.4]), 9)) for s in signs}
    assert corners == wanted
    post = bodies["posts 1"]
    assert np.allclose(np.abs(post.axes[:, 2]), [1.0, 0.0, 0.0]) and np.allclose(post.centre, [0.0, 1.0, 0.3])
    assert np.allclose(post.half, [0.05, 0.05, 0.3])
    assert bodies["posts 2"].radius == 0.1 and np.allclose(bodies["posts 2"].centre, [0.0, -1.0, 0.0])
    part = bodies["part"]
    assert robot.model.names[part.joint] == "b" and np.allclose(part.centre, [0.3, 0.0, 0.05])


def test_a_limit_that_nobody_gave_is_left_to_be_filled_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, request = written(tmp_path)
    task, urdf = tmp_path / "task.toml", tmp_path / "arm.urdf"
    options = ["--urdf", str(urdf), "--set", "limits.jerk=none", "--set", "limits.effort=none", "-o", str(task)]
    assert run(["import", str(scene), str(request), *options]) == 0
    assert "to fill in before it can be solved, no file holds them: limits.acceleration" in capsys.readouterr().err
    assert run(["show", str(task)]) == 2
    words = capsys.readouterr().err
    assert "[limits] acceleration is 'TO FILL IN'; give a number above zero" in words and words.count("\n") == 1
    assert run(["show", str(task), "--set", "limits.acceleration=8"]) == 0


def test_a_robot_by_name_and_joints_that_stay(tmp_path: Path) -> None:
    # Its own file locks what the goal does not move, at the start; a mimic joint and fixed ones as well.
    names = [f"panda_joint{i}" for i in range(1, 8)]
    fingers = ["panda_finger_joint1", "panda_finger_joint2"]
    request = {
        "start_state": {
            "joint_state": {"name": names + fingers, "position": [0, -0.785, 0, -2.356, 0, 1.571, 0.785, 0.02, 0.02]}
        },
        "goal_constraints": [{"joint_constraints": [{"joint_name": n, "position": -0.5} for n in names]}],
    }
    files = written(tmp_path, {"world": {}}, request)
    made = import_scene(*files, tmp_path / "task.toml", changes={"robot.description": "panda", **LIMITS})
    task = tomllib.loads(made.text)
    assert task["robot"] == {"locked": dict.fromkeys(fingers, 0.02), "description": "panda"}
    assert "obstacle" not in task["collision"]


Change = Callable[[dict[str, Any]], Any]


def put(*keys: Any) -> Change:
    """A change that puts the last of its arguments at the place that the others lead to."""
    *way, last, value = keys

    def change(data: dict[str, Any]) -> None:
        here: Any = data
        for key in way:
            here = here[key]
        here[last] = value

    return change


def drop(*keys: Any) -> Change:
    *way, last = keys

    def change(data: dict[str, Any]) -> None:
        here: Any = data
        for key in way:
            here = here[key]
        del here[last]

    return change


WALL, POSTS = ("world", "collision_objects", 0), ("world", "collision_objects", 1)
HELD = ("robot_state", "attached_collision_objects", 0)
GOAL = ("goal_constraints", 0)
JOINTS = (*GOAL, "joint_constraints")
STATE = ("start_state", "joint_state")
WRONG_SCENES: list[tuple[Any, str]] = [
    ("[1, 2", "scene.yaml is not a planning scene: not YAML"),
    ("", "scene.yaml is not a planning scene: it is empty"),
    ("- 1", "it is no table"),
    ("a: 1\n---\nb: 1", "it is several documents"),
    (put("wrold", {}), "wrold is not of a planning scene (nearest is 'world')"),
    (drop("world"), "world is missing or empty; give a table with collision_objects"),
    (put("world", 3), "world is 3; give a table"),
    (put("world", "collision_objects", {"id": "wall"}), "world.collision_objects is {'id': 'wall'}; give a list"),
    (drop(*WALL, "id"), "world.collision_objects[0].id is missing or empty; give a name"),
    (put(*POSTS, "id", "wall"), "world.collision_objects[1].id is 'wall', as is world.collision_objects[0].id"),
    (
        put(*WALL, "meshes", [{"triangles": [], "vertices": []}]),
        "world.collision_objects[0].meshes are a part of 'wall'; meshes are not",
    ),
    (put(*WALL, "planes", [{"coef": [0, 0, 1, 0]}]), "[0].planes are a part of 'wall'; planes are not supported"),
    (put(*WALL, "operation", 1), "[0].operation of 'wall' is 1; a body can only be added"),
    (put(*WALL, "header", {"frame_id": "plate"}), "[0].header.frame_id is 'plate'; give the world"),
    (put(*WALL, "primitives", []), "[0].primitives is []; give a list of one or more boxes"),
    (put(*WALL, "primitive_poses", []), "[0].primitive_poses of 'wall' has 0 poses for 1 primitives; give one each"),
    (
        put(*WALL, "primitives", 0, "type", "cone"),
        "[0].primitives[0].type is 'cone'; give box, cylinder or sphere for 'wall'",
    ),
    (put(*WALL, "primitives", 0, "type", 4), "[0].primitives[0].type is 4; give box, cylinder or sphere"),
    (
        put(*WALL, "primitives", 0, "dimensions", [1, 2]),
        "[0].primitives[0].dimensions is [1, 2]; give x, y, z [m] of the box",
    ),
    (
        put(*WALL, "primitives", 0, "dimensions", [1, 2, 0]),
        "[0].primitives[0].dimensions[2] is 0; give a length above zero",
    ),
    (
        put(*WALL, "primitives", 0, "dimensions", [1, "2", 3]),
        "[0].primitives[0].dimensions[1] is '2'; give a length above",
    ),
    (put(*WALL, "primitives", 0, "dimensions", [1, float("nan"), 3]), "dimensions[1] is nan; give a length above zero"),
    (put(*WALL, "pose", "position", [1, 2]), "[0].pose.position is [1, 2]; give three numbers x, y, z [m]"),
    (
        put(*WALL, "pose", "position", [1, 2, True]),
        "[0].pose.position[2] is True; give three numbers x, y, z [m], finite",
    ),
    (
        put(*WALL, "pose", "orientation", [0, 0, 0, 0]),
        "[0].pose.orientation is [0, 0, 0, 0]; give a quaternion x, y, z, w of norm",
    ),
    (put(*WALL, "pose", "orientation", [0, 0, 1]), "[0].pose.orientation is [0, 0, 1]; give four numbers x, y, z, w"),
    (put(*WALL, "pose", "position", {"x": 0, "y": 0, "q": 0}), "[0].pose.position.q is not of a planning scene"),
    (put(*WALL, "pose", "turned", 1), "[0].pose.turned is not of a planning scene"),
    (put("world", "octomap", "octomap", "data", [1, 2]), "world.octomap is an octomap, which is not supported"),
    (
        put("fixed_frame_transforms", 0, "transform", "translation", [1, 0, 0]),
        "fixed_frame_transforms[0].transform moves a frame",
    ),
    (put("link_padding", [{"link_name": "upper", "padding": 0.1}]), "link_padding[0] changes the size of a link"),
    (
        put("allowed_collision_matrix", "entry_values", 0, 1, True),
        "entry_values[0][1] lets 'a' touch 'wall'; not supported",
    ),
    (put("allowed_collision_matrix", "entry_values", [[True, True]]), "entry_values has 1 rows for 2 entry_names"),
    (put("allowed_collision_matrix", "default_entry_names", ["wall"]), None),
    (
        put(*HELD, "link_name", "plat"),
        "'part' is held by, or may touch, 'plat'; the robot has no such link (nearest is 'plate')",
    ),
    (put(*HELD, "touch_links", ["upper"]), "'part' may touch 'upper', which moves against 'plate' that holds it"),
    (put(*HELD, "object", "meshes", [{}]), "attached_collision_objects[0].object.meshes are a part of 'part'"),
    (
        put("robot_state", "joint_state", "position", [0.0]),
        "robot_state.joint_state.position has 1 numbers for 3 names",
    ),
    (
        put("robot_state", "multi_dof_joint_state", {"transforms": [{"translation": [1, 0, 0]}]}),
        "multi_dof_joint_state.transforms[0] moves the robot's base",
    ),
]
WRONG_REQUESTS: list[tuple[Any, str]] = [
    ("{", "request.yaml is not a motion request: not YAML"),
    (put("goals", []), "goals is not of a motion request"),
    (drop("goal_constraints"), "goal_constraints has 0 goals; give one"),
    (put("goal_constraints", [{}, {}]), "goal_constraints has 2 goals; give one"),
    (
        put(*GOAL, "position_constraints", [{"link_name": "plate"}]),
        "goal_constraints[0].position_constraints are not supported",
    ),
    (put(*GOAL, "orientation_constraints", [{}]), "goal_constraints[0].orientation_constraints are not supported"),
    (put(*GOAL, "joint_constraints", []), "goal_constraints[0].joint_constraints is []; give one for each joint"),
    (put(*JOINTS, 0, "joint_name", "c"), "goal_constraints[0]: the robot has no joint 'c' that moves"),
    (put(*JOINTS, 0, "joint_name", "a"), "joint_constraints[1].joint_name names the joint 'a' a second time"),
    (put(*JOINTS, 0, "position", None), "joint_constraints[0].position is missing or empty; give a finite number"),
    (put(*JOINTS, 0, "position", float("inf")), "joint_constraints[0].position is inf; give a finite number"),
    (put(*JOINTS, 0, "tolerance_above", -1), "joint_constraints[0].tolerance_above is -1; give a number, 0 or more"),
    (
        put("path_constraints", {"orientation_constraints": [{}]}),
        "path_constraints.orientation_constraints hold along the way",
    ),
    (put("trajectory_constraints", {"constraints": [{}]}), "trajectory_constraints are not supported"),
    (put("max_cartesian_speed", 0.3), "max_cartesian_speed is 0.3; a limit on the speed of a link is not supported"),
    (put("max_velocity_scaling_factor", 2), "max_velocity_scaling_factor is 2; give a number from 0 to 1"),
    (
        put("max_acceleration_scaling_factor", 0.5),
        "max_acceleration_scaling_factor is 0.5, of a limit that no URDF holds",
    ),
    (drop("start_state"), "start_state.joint_state is missing or empty; give the state that the motion begins in"),
    (put(*STATE, "name", ["b", "a", "a"]), "start_state.joint_state.name[2] names the joint 'a' a second time"),
    (put(*STATE, "velocity", [0, 0.5, 0]), "start_state.joint_state.velocity[1] is 0.5; give 0"),
    (put("start_state", {"joint_state": {"name": ["a", "b"], "position": [0, 0]}}), "says nothing of the joint 'grip'"),
    (put("start_state", {"joint_state": {"name": ["a", "grip"], "position": [0, 0]}}), "says nothing of the joint 'b'"),
    (put(*STATE, "position", [-0.5, 1.25, 0.02]), "the goal is where the motion starts"),
]


@pytest.mark.parametrize(
    "which", [*((0, i) for i in range(len(WRONG_SCENES))), *((1, i) for i in range(len(WRONG_REQUESTS)))]
)
def test_what_is_wrong_is_one_line_with_file_and_place(tmp_path: Path, which: tuple[int, int]) -> None:
    kind, number = which
    change, words = (WRONG_SCENES, WRONG_REQUESTS)[kind][number]
    data: list[Any] = [copy.deepcopy(SCENE), copy.deepcopy(REQUEST)]
    if isinstance(change, str):
        data[kind] = change
    else:
        change(data[kind])
    files = written(tmp_path, *data)
    with_urdf = {"urdf": tmp_path / "arm.urdf", "changes": LIMITS}
    if words is None:  # the same, and nothing wrong with it
        import_scene(*files, tmp_path / "task.toml", **with_urdf)
        return
    with pytest.raises(InputError) as caught:
        import_scene(*files, tmp_path / "task.toml", **with_urdf)
    message = str(caught.value)
    assert words in message and "\n" not in message
    if "'part'" not in words or "attached" in words:
        assert ("scene.yaml", "request.yaml")[kind] in message
    assert not (tmp_path / "task.toml").exists()


WRONG_OPTIONS = [
    ([], "which robot it is of, robot_model_name 'arm', only its description says; give --urdf FILE"),
    (["--urdf", "no.urdf"], "cannot read the URDF file no.urdf"),
    (["--urdf", "arm.urdf", "--srdf", "no.srdf"], "cannot read the SRDF file no.srdf"),
    (
        ["--urdf", "arm.urdf", "--set", "limits.accelleration=8"],
        "accelleration is not allowed (nearest is 'acceleration')",
    ),
    (
        ["--urdf", "arm.urdf", "--set", "limits.acceleration=-8"],
        "[limits] acceleration is -8; give a number above zero",
    ),
    (
        ["--urdf", "arm.urdf", "--set", "limits.velocity=2"],
        "max_velocity_scaling_factor is 0.5, and --set gives limits.velocity",
    ),
    (["--urdf", "arm.urdf", "--set", "robot.locked.grip=x"], "--set robot.locked.grip is 'x'; give a number"),
    (["--urdf", "arm.urdf", "-o", "task.yaml"], "-o is 'task.yaml'; a task file ends in .toml"),
]


@pytest.mark.parametrize(("options", "words"), WRONG_OPTIONS)
def test_a_wrong_option_is_one_line_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], options: list[str], words: str
) -> None:
    written(tmp_path)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    out = [] if "-o" in options else ["-o", "task.toml"]
    assert run(["import", "scene.yaml", "request.yaml", *options, *out]) == 2
    message = capsys.readouterr().err
    assert words in message and message.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == before
