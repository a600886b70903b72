"""Convex bodies: their supports, distances, data; capsules around meshes; the bodies and pairs of a robot."""

import json
from pathlib import Path
from typing import Any

import casadi
import coal
import numpy as np
import pinocchio as pin
import pytest

from ocp_traj.errors import FileFormatError, InputError, RobotDefinitionError
from ocp_traj.robot.bodies import Body, box, capsule, cylinder, half_space, sphere
from ocp_traj.robot.body_pairs import (
    disabled_collisions,
    obstacle_pairs,
    random_postures,
    self_pairs,
)
from ocp_traj.robot.capsule_fit import clipped, fit_capsules
from ocp_traj.robot.cores import Cores, group_of
from ocp_traj.robot.descriptions import description_urdf, package_folders
from ocp_traj.robot.nearest_points import nearest
from ocp_traj.robot.pair_distances import PairDistances
from ocp_traj.robot.placements import placements_function
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf_bodies import mesh_triangles, urdf_bodies
from tests.independent.bodies import extent
from tests.random_robots import random_model, random_placement

FINITE = ("sphere", "capsule", "box", "cylinder")


def placed(bodies: list[Body], rotation: np.ndarray, position: np.ndarray) -> Cores:
    """Cores of bodies whose joints have rotations ``(N, 3, 3)`` and positions ``(N, 3)``."""
    centre, axes, half = (np.array([getattr(body, name) for body in bodies]) for name in ("centre", "axes", "half"))
    world = np.einsum("nij,nj->ni", rotation, centre) + position
    half = np.where(np.isfinite(half), half, 0.0)
    return Cores(np.array([group_of(body) for body in bodies]), world, rotation @ axes, half)


def some(rng: np.random.Generator, kind: str, name: str = "b", joint: int = 0) -> Body:
    at, size = random_placement(rng), np.exp(rng.uniform(-4.0, -0.5, size=3))
    ends = at.translation, at.translation + at.rotation[:, 0] * size[0]
    if kind == "sphere":
        return sphere(name, joint, at.translation, size[0])
    if kind == "half-space":
        return half_space(name, rng.normal(size=3), float(rng.normal()))
    if kind == "box":
        return box(name, joint, at.translation, size, at.rotation)
    return (capsule if kind == "capsule" else cylinder)(name, joint, *ends, size[1])


# --- bodies ---


@pytest.mark.parametrize("kind", FINITE)
def test_the_support_is_that_of_vertices_and_of_coal(kind: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        body, direction = some(rng, kind), rng.normal(size=3)
        size = float(np.linalg.norm(direction))
        along = body.axes.T @ direction
        expected = float(direction @ body.centre) + extent(body, along) + body.radius * size
        assert body.support(direction) == pytest.approx(expected, rel=1e-12)
        if kind == "cylinder":
            with pytest.raises(InputError, match="has no vertices"):
                body.vertices  # noqa: B018
        else:
            assert (body.vertices @ direction).max() + body.radius * size == pytest.approx(expected, rel=1e-12)
        shape, placement = body.coal()
        plane = coal.Halfspace(direction / size, expected / size + 0.3)  # 0.3 m of it are inside, no more
        result = coal.DistanceResult()
        at = coal.Transform3s(placement)
        beyond = coal.Halfspace(-direction / size, -expected / size - 0.3)
        found = coal.distance(shape, at, beyond, coal.Transform3s.Identity(), coal.DistanceRequest(), result)
        assert found == pytest.approx(0.3, abs=1e-6), plane


def test_bodies_are_plain_data() -> None:
    rng, model = np.random.default_rng(1), random_model(np.random.default_rng(1), 3)
    for kind in (*FINITE, "half-space"):
        body = some(rng, kind, joint=0 if kind == "half-space" else 2)
        data = json.loads(json.dumps(body.to_data(model)))
        again = Body.from_data(model, data)
        assert again.to_data(model) == body.to_data(model) and again.joint == body.joint
        assert np.array_equal(again.half, body.half) and again.kind == kind
        for name in data:
            with pytest.raises(InputError, match="it takes"):
                Body.from_data(model, {key: value for key, value in data.items() if key != name})
    data = sphere("a", 1, [0.0, 0.0, 0.0], 0.1).to_data(model)
    for name, value, words in (
        ("joint", "nowhere", "is not a joint"), ("radius", "0.1", "give a number"), ("radius", -1.0, "radius -1"),
        ("kind", "ball", "allowed are sphere"), ("centre", [0.0, None, 0.0], "finite numbers"),
        ("axes", [[1, 0, 0], [0, 1, 0], [0, 0, 2]], "give a rotation"), ("half", [0.0, 0.0], "3 finite numbers"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words):
            Body.from_data(model, {**data, name: value})


def test_a_body_is_refused_in_one_line() -> None:
    for made, words in (
        (lambda: sphere("a", 0, [0, 0, 0], 0.0), "radius 0.0"),
        (lambda: sphere("a", 0, [0, 0], 0.1), "3 finite numbers"),
        (lambda: capsule("a", 0, [0, 0, np.nan], [0, 0, 1], 0.1), "an end is"),
        (lambda: cylinder("a", 0, [0, 0, 1], [0, 0, 1], 0.1), "two different points"),
        (lambda: box("a", 0, [0, 0, 0], [1.0, 0.0, 1.0]), "three numbers above zero"),
        (lambda: half_space("a", [0, 0, 0], 0.0), "give a direction"),
        (lambda: half_space("a", [0, 0, 1], np.inf), "give a direction"),
        (lambda: Body("a", "half-space", 1, np.zeros(3), np.eye(3), np.full(3, np.inf), 0.0), "stands still"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=words) as error:
            made()
        assert "\n" not in str(error.value)


def test_frames_of_joints_are_where_pinocchio_has_them() -> None:
    for seed in range(6):
        rng = np.random.default_rng(seed)
        model = random_model(rng, 5, branching=True)
        units = tuple("rad" if "R" in model.joints[i].shortname() else "m" for i in range(1, model.njoints))
        robot = Robot(model, tuple(model.names)[1:], units)
        q, data = rng.normal(size=5), model.createData()
        pin.forwardKinematics(model, data, q)
        frames = np.array(placements_function(robot, range(model.njoints))(q)).reshape(-1, 12)
        symbol = casadi.SX.sym("q", 5)
        for joint in range(model.njoints):
            place = data.oMi[joint]
            assert frames[joint] == pytest.approx(np.r_[place.rotation.ravel(), place.translation], abs=1e-13)
            found = casadi.Function("pose", [symbol], list(robot.joint_pose(symbol, joint)))(q)
            assert np.array(found[0]) == pytest.approx(place.rotation, abs=1e-12)
            assert np.array(found[1]).ravel() == pytest.approx(place.translation, abs=1e-12)


# --- distances ---


@pytest.mark.parametrize("second", [*FINITE, "half-space"])
@pytest.mark.parametrize("first", FINITE)
def test_nearest_points_and_directions_close_the_gap(first: str, second: str) -> None:
    """The points are in the cores, and no further apart than the direction holds the cores: both are the best."""
    rng = np.random.default_rng(5)
    count = 20 if {first, second} <= {"box", "cylinder"} else 100
    ones, twos = ([some(rng, kind) for _ in range(count)] for kind in (first, second))
    still = np.repeat(np.eye(3)[None], count, axis=0), np.zeros((count, 3))
    a, b = placed(ones, *still), placed(twos, *still)
    for one, two, x, y, normal in zip(ones, twos, *nearest(a, b), strict=True):
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-14)
        reach = one.support(-normal) - one.radius + two.support(normal) - two.radius
        gap = float(normal @ (x - y))
        if second != "half-space" and np.linalg.norm(x - y) < 1e-9:
            continue  # cores that meet have no such direction
        assert gap + reach == pytest.approx(0.0, abs=1e-9)
        for body, point in ((one, x), (two, y)):
            local = np.abs(body.axes.T @ (point - body.centre))
            if body.kind == "cylinder":
                assert np.hypot(local[0], local[1]) <= body.half[0] + 1e-12 and local[2] <= body.half[2] + 1e-12
            elif body.kind != "half-space":
                assert (local <= body.half + 1e-12).all()


# --- capsules around meshes ---


def inside(capsules: Any, points: np.ndarray) -> np.ndarray:
    """How far points are inside the capsule or cylinder that holds them best."""
    best = np.full(len(points), -np.inf)
    for c in capsules:
        span = c.end - c.start
        length = float(np.linalg.norm(span))
        share = (points - c.start) @ span / length**2 if length > 0.0 else np.zeros(len(points))
        if c.flat:
            off = np.linalg.norm(points - c.start - share[:, None] * span, axis=1)
            depth = np.minimum(c.radius - off, np.minimum(share, 1.0 - share) * length)
        else:
            depth = c.radius - np.linalg.norm(points - c.start - np.clip(share, 0.0, 1.0)[:, None] * span, axis=1)
        best = np.maximum(best, depth)
    return best


def on_triangles(rng: np.random.Generator, triangles: np.ndarray, count: int) -> np.ndarray:
    weights = rng.dirichlet(np.full(3, 0.5), size=count)
    return np.asarray(np.einsum("nk,nkj->nj", weights, triangles[rng.integers(len(triangles), size=count)]))


@pytest.mark.slow
@pytest.mark.parametrize("cylinders", [False, True])
def test_capsules_enclose_the_triangles_and_not_the_corners_alone(cylinders: bool) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        triangles = rng.normal(size=(40, 3, 3)) * np.array([0.02, 0.05, 0.4]) + rng.normal(size=(40, 1, 3)) * 0.05
        capsules, parts = fit_capsules(triangles, most=5, cylinders=cylinders)
        assert 1 <= len(capsules) == len(parts) <= 5
        assert inside(capsules, on_triangles(rng, triangles, 20_000)).min() >= -1e-12
        for c, part in zip(capsules, parts, strict=True):  # so that the hull of each is inside as well
            assert inside([c], part.reshape(-1, 3)).min() >= 0.0
        assert [c.radius for c in fit_capsules(triangles, most=5, cylinders=cylinders)[0]] == [
            c.radius for c in capsules
        ]


def test_clipping_keeps_what_is_on_one_side() -> None:
    rng = np.random.default_rng(3)
    triangles, normal = rng.normal(size=(200, 3, 3)), np.array([0.6, 0.0, 0.8])
    low, high = clipped(triangles, normal, 0.1), clipped(triangles, -normal, -0.1)

    def area(corners: np.ndarray) -> float:
        return float(
            np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        )

    assert area(low) + area(high) == pytest.approx(area(triangles), rel=1e-12)
    assert (low @ normal).max() <= 0.1 + 1e-12 and (high @ normal).min() >= 0.1 - 1e-12


def test_a_capsule_is_found_again_and_a_rod_needs_one() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    ring = np.column_stack([0.03 * np.cos(turns), 0.03 * np.sin(turns), np.zeros(40)])
    layers = [ring + [0.0, 0.0, z] for z in np.linspace(0.0, 0.5, 20)]
    triangles = np.array(
        [[a[k], a[k - 1], b[k]] for a, b in zip(layers[:-1], layers[1:], strict=True) for k in range(40)]
    )
    (found,), _ = fit_capsules(triangles, standoff=0.031)
    assert found.radius == pytest.approx(0.03, rel=1e-3) and found.standoff <= 0.031
    (flat,), _ = fit_capsules(triangles, cylinders=True)
    assert flat.flat and flat.radius == pytest.approx(0.03, rel=1e-3) and flat.standoff < 1e-3
    for wrong in (np.zeros((0, 3, 3)), np.zeros((4, 3)), np.full((1, 3, 3), np.nan)):
        with pytest.raises(InputError, match="give"):
            fit_capsules(wrong)


# --- bodies and pairs of robots ---


@pytest.fixture(scope="module")
def ur5() -> tuple[Robot, tuple[Body, ...]]:
    robot = Robot.from_description("ur5")
    return robot, urdf_bodies(robot.model, description_urdf("ur5"))


def test_meshes_are_never_nearer_than_the_capsules_around_them(ur5: tuple[Robot, tuple[Body, ...]]) -> None:
    robot, bodies = ur5
    urdf = description_urdf("ur5")
    with pytest.warns(UserWarning, match="package dir"):
        geometry = pin.buildGeomFromUrdf(
            robot.model, str(urdf), pin.GeometryType.COLLISION, [str(f) for f in package_folders(urdf)]
        )
    rng, data = np.random.default_rng(0), robot.model.createData()
    for piece in geometry.geometryObjects:
        link = robot.model.frames[piece.parentFrame].name
        own = [body for body in bodies if body.link == link]
        assert own and all(body.joint == piece.parentJoint for body in own)
        if hasattr(piece.geometry, "tri_indices"):
            points = on_triangles(rng, mesh_triangles(piece.geometry), 3000)
            points = points @ piece.placement.rotation.T + piece.placement.translation
            depth = np.full(len(points), -np.inf)
            for body in own:
                local = (points - body.centre) @ body.axes
                off = np.linalg.norm(local - np.clip(local, -body.half, body.half), axis=1)
                depth = np.maximum(depth, body.radius - off)
            assert depth.min() >= -1e-12, link
    ball = sphere("ball", 0, [0.5, 0.1, 0.4], 0.05)
    everything = (*bodies, ball)
    pairs = obstacle_pairs(everything, [len(bodies)])
    postures = random_postures(robot, 20)
    found = PairDistances(robot, [(everything[i], everything[j]) for i, j in pairs]).least(postures)
    geometry.addGeometryObject(pin.GeometryObject("ball", 0, pin.SE3(np.eye(3), ball.centre), coal.Sphere(0.05)))
    for k in range(1, len(geometry.geometryObjects) - 1):
        geometry.addCollisionPair(pin.CollisionPair(k, len(geometry.geometryObjects) - 1))
    distances = geometry.createData()
    for q, least in zip(postures, found, strict=True):
        pin.computeDistances(robot.model, data, geometry, distances, q)
        assert min(result.min_distance for result in distances.distanceResults) >= least - 1e-9


def test_pairs_are_of_links_that_are_no_neighbours(ur5: tuple[Robot, tuple[Body, ...]], tmp_path: Path) -> None:
    robot, bodies = ur5
    found = self_pairs(robot, bodies)
    links = {(bodies[i].link, bodies[j].link) for i, j in found.pairs}
    assert ("wrist_1_link", "wrist_3_link") in links and ("wrist_1_link", "ee_link") in links
    assert not links & {("wrist_2_link", "ee_link"), ("wrist_2_link", "wrist_3_link"), ("wrist_3_link", "ee_link")}
    srdf = tmp_path / "a.srdf"
    srdf.write_text('<robot name="a"><disable_collisions link1="ee_link" link2="wrist_1_link" reason="x"/></robot>')
    fewer = self_pairs(robot, bodies, disabled=disabled_collisions(srdf))
    assert fewer.disabled == (("wrist_1_link", "ee_link"),) and len(fewer.pairs) == len(found.pairs) - 1
    for text, words in (
        ("<robot", "not XML"),
        ("<urdf/>", "expected <robot>"),
        ('<robot><disable_collisions link1="a"/></robot>', "link1 and link2"),
    ):  # noqa: E501
        srdf.write_text(text)
        with pytest.raises(FileFormatError, match=words):
            disabled_collisions(srdf)


def test_links_that_always_touch_are_left_out_and_listed(ur5: tuple[Robot, tuple[Body, ...]]) -> None:
    robot, bodies = ur5
    cuff = sphere("cuff", 4, [0.0, 0.0, 0.0], 0.4)  # around all that is near the wrist
    found = self_pairs(robot, (*bodies, cuff))
    assert ("wrist_3_link", "cuff") in found.touching and ("ee_link", "cuff") in found.touching
    names = {((*bodies, cuff)[i].link, (*bodies, cuff)[j].link) for i, j in found.pairs}
    assert not names & set(found.touching)
    assert self_pairs(robot, (*bodies, cuff)) == found


URDF = """<robot name="r"><link name="base"/><link name="arm">
<collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>
<collision><origin rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.02" length="0.4"/></geometry></collision>
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"><collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
<joint name="{name}" type="{kind}"><parent link="arm"/><child link="tool"/><origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""


def test_spheres_boxes_and_cylinders_of_a_urdf_are_taken_as_they_are() -> None:
    text = URDF.format(name="k", kind="fixed")
    bodies = urdf_bodies(Robot.from_urdf(text).model, text)
    assert [body.name for body in bodies] == ["arm/0", "arm/1", "tool/0"] and {body.joint for body in bodies} == {1}
    ball, can, block = bodies
    assert (ball.kind, ball.radius, ball.centre.tolist()) == ("sphere", 0.05, [0.1, 0.0, 0.0])
    assert can.kind == "cylinder" and can.half == pytest.approx([0.02, 0.02, 0.2]) and abs(can.normal[0]) == 1.0
    assert block.kind == "box" and block.half == pytest.approx([0.05, 0.1, 0.15])
    assert block.centre == pytest.approx([0.5, 0.0, 0.0])
    moving = URDF.format(name="k", kind="revolute")
    locked = urdf_bodies(Robot.from_urdf(moving, locked={"k": 0.7}).model, moving)
    assert locked[2].joint == 1 and locked[2].axes[:, 0] == pytest.approx([np.cos(0.7), np.sin(0.7), 0.0])
    assert urdf_bodies(Robot.from_urdf(moving).model, moving)[2].joint == 2
    with pytest.raises(RobotDefinitionError, match="which the robot's model has not"):
        urdf_bodies(Robot.from_urdf(text.replace('"tool"', '"gripper"')).model, text)
