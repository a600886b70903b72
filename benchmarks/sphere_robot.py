"""A robot of spheres among boxes, cylinders and spheres, by code of its own: to check what the package says of motions.

Kinematics come from the URDF's text, obstacles from the scene's YAML: nothing here is imported from the package.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

Array = NDArray[np.float64]
CHUNK = 4000  # postures at once


def turned(angle: Array, axis: Array) -> Array:
    """Rotations ``(N, 3, 3)`` by angles ``(N,)`` about a unit vector."""
    x, y, z = axis
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    return np.eye(3) + s * k + (1.0 - c) * (k @ k)


def _rpy(text: str) -> Array:
    r, p, y = (turned(np.array([float(v)]), axis)[0] for v, axis in zip(text.split(), np.eye(3), strict=True))
    return y @ p @ r


def _origin(element: ElementTree.Element | None) -> tuple[Array, Array]:
    if element is None:
        return np.eye(3), np.zeros(3)
    return _rpy(element.get("rpy", "0 0 0")), np.array([float(v) for v in element.get("xyz", "0 0 0").split()])


class SphereRobot:
    """Spheres of a URDF's collision geometry, and the pairs of them that have to keep apart.

    Attributes:
        joints: those that move, in the order of coordinates.
        low, high, speed: limits of the file ``(n,)``.
    """

    def __init__(self, urdf: Path, srdf: Path, joints: tuple[str, ...]) -> None:
        """Reads both files; pairs of one joint, of neighbours and of the SRDF are left out."""
        root = ElementTree.parse(urdf).getroot()
        self.joints = joints
        parents = {j.find("child").get("link"): j for j in root.iter("joint") if j.find("child") is not None}  # type: ignore[union-attr]
        names = [str(link.get("name")) for link in root.iter("link")]
        self._order: list[tuple[str, str, Array, Array, int, Array]] = []
        done: set[str] = set()

        def visit(link: str) -> None:
            if link in done:
                return
            done.add(link)
            joint = parents.get(link)
            if joint is None:
                self._order.append((link, "", np.eye(3), np.zeros(3), -1, np.zeros(3)))
                return
            parent = str(joint.find("parent").get("link"))  # type: ignore[union-attr]
            visit(parent)
            axis = joint.find("axis")
            direction = np.array([float(v) for v in ("1 0 0" if axis is None else axis.get("xyz", "1 0 0")).split()])
            name = str(joint.get("name"))
            number = joints.index(name) if name in joints else -1
            self._order.append((link, parent, *_origin(joint.find("origin")), number, direction))

        for name in names:
            visit(name)
        limits = {str(j.get("name")): j.find("limit") for j in root.iter("joint")}
        self.low, self.high, self.speed = (
            np.array([float(limits[name].get(key)) for name in joints])  # type: ignore[union-attr, arg-type]
            for key in ("lower", "upper", "velocity")
        )
        self.links: list[str] = []
        centres, radii = [], []
        for link in root.iter("link"):
            for part in link.findall("collision"):
                ball = part.find("geometry/sphere")
                if ball is not None:
                    self.links.append(str(link.get("name")))
                    centres.append(_origin(part.find("origin"))[1])
                    radii.append(float(ball.get("radius", "nan")))
        self.centres, self.radii = np.array(centres), np.array(radii)
        carrier = {link: link for link in names}  # the first link of all that are fixed to each other
        for link, parent, _, _, number, _ in self._order:
            if parent and number < 0:
                carrier[link] = carrier[parent]
        neighbours = {frozenset((carrier[link], carrier[parent])) for link, parent, *_ in self._order if parent}
        touching = {
            frozenset((str(d.get("link1")), str(d.get("link2"))))
            for d in ElementTree.parse(srdf).getroot().iter("disable_collisions")
        }
        direct = {frozenset((link, parent)) for link, parent, *_ in self._order if parent}
        self.fixed = np.array([carrier[link] == carrier[self._order[0][0]] for link in self.links])
        pairs = [
            (a, b)
            for a, b in combinations(range(len(radii)), 2)
            if carrier[self.links[a]] != carrier[self.links[b]]
            and frozenset((self.links[a], self.links[b])) not in touching | direct
        ]
        self.neighbours = neighbours
        self.pairs = np.array(pairs).reshape(-1, 2)
        # What overlaps at every one of many postures is a matter of how the robot is built.
        q = np.random.default_rng(0).uniform(self.low, self.high, size=(400, len(joints)))
        always = self._between(self.placed(q)).max(axis=0) < 0.0
        apart = {frozenset((self.links[a], self.links[b])) for a, b in self.pairs[always].tolist()}
        keep = [frozenset((self.links[a], self.links[b])) not in apart for a, b in self.pairs.tolist()]
        self.pairs = self.pairs[keep]

    def placed(self, q: Array) -> Array:
        """Centres ``(N, spheres, 3)`` at postures ``(N, n)``."""
        frames: dict[str, tuple[Array, Array]] = {}
        for link, parent, rotation, position, number, axis in self._order:
            if not parent:
                frames[link] = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
                continue
            turn, place = frames[parent]
            place = place + turn @ position
            turn = turn @ rotation
            frames[link] = (turn if number < 0 else turn @ turned(q[:, number], axis)), place
        found = np.empty((len(q), len(self.radii), 3))
        for i, link in enumerate(self.links):
            found[:, i] = frames[link][0] @ self.centres[i] + frames[link][1]
        return found

    def _between(self, centres: Array) -> Array:
        a, b = self.pairs.T
        return np.asarray(np.linalg.norm(centres[:, a] - centres[:, b], axis=2) - self.radii[a] - self.radii[b])


class Cell:
    """A robot among the bodies of a planning scene."""

    def __init__(self, robot: SphereRobot, scene: Path) -> None:
        """Reads the scene's boxes, cylinders and spheres."""
        self.robot = robot
        data: Any = yaml.load(scene.read_text(), Loader=yaml.CSafeLoader)
        self.bodies = []
        for item in data["world"]["collision_objects"]:
            turn, place = _pose(item.get("pose") or {})
            for primitive, pose in zip(item["primitives"], item["primitive_poses"], strict=True):
                own, at = _pose(pose)
                self.bodies.append(
                    (primitive["type"], np.array(primitive["dimensions"]), turn @ own, turn @ at + place)
                )

    def clearance(self, q: Array) -> Array:
        """The least distance at postures ``(N, n)``, ``(N,)``: of spheres that move from bodies and from each other."""
        return np.concatenate([self._clearance(q[i : i + CHUNK]) for i in range(0, len(q), CHUNK)])

    def _clearance(self, q: Array) -> Array:
        centres = self.robot.placed(q)
        least = self.robot._between(centres).min(axis=1)
        moving = ~self.robot.fixed
        for kind, sizes, turn, place in self.bodies:
            least = np.minimum(
                least,
                (_outside(kind, sizes, (centres[:, moving] - place) @ turn) - self.robot.radii[moving]).min(axis=1),
            )
        return np.asarray(least)


def _pose(data: dict[str, Any]) -> tuple[Array, Array]:
    x, y, z, w = np.array(data.get("orientation", [0.0, 0.0, 0.0, 1.0]), dtype=float)
    size = x * x + y * y + z * z + w * w
    turn = np.eye(3) + 2.0 / size * np.array([
        [-y * y - z * z, x * y - z * w, x * z + y * w],
        [x * y + z * w, -x * x - z * z, y * z - x * w],
        [x * z - y * w, y * z + x * w, -x * x - y * y],
    ])  # fmt: skip
    return turn, np.array(data.get("position", [0.0, 0.0, 0.0]), dtype=float)


def _outside(kind: str, sizes: Array, points: Array) -> Array:
    """Signed distance of points ``(.., 3)`` in a body's own frame."""
    if kind == "sphere":
        return np.asarray(np.linalg.norm(points, axis=-1) - sizes[0])
    if kind == "cylinder":
        height, radius = sizes
        beyond = np.stack(
            [np.hypot(points[..., 0], points[..., 1]) - radius, np.abs(points[..., 2]) - 0.5 * height], -1
        )
    else:
        beyond = np.abs(points) - 0.5 * sizes
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0))
