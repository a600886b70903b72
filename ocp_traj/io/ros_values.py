"""Values of ROS messages in YAML: each knows where it stands, so that a complaint is one line with file and place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml

from ocp_traj.arrays import Array
from ocp_traj.errors import MOST_NAMES, FileFormatError, cut, nearest, quoted
from ocp_traj.files import LONGEST_PATH, read_text
from ocp_traj.paths.path_points import LOADER

LARGEST = 1e6  # of a coordinate or dimension: our choice, beyond any work cell
UNIT = 1e-3  # how far a quaternion's norm may be from one: our choice, above what three digits leave


@dataclass(frozen=True)
class Node:
    """A value and its place.

    Attributes:
        value: plain YAML; None where there is nothing.
        file: as messages call it.
        place: such as ``world.collision_objects[2].id``; empty for the whole file.
        what: the file should have been, such as "planning scene".
    """

    value: Any
    file: str
    what: str
    place: str = ""

    def wrong(self, allowed: str) -> FileFormatError:
        """The complaint that it is not what it has to be."""
        if self.value is None:
            return FileFormatError(f"{self.file}: {self.place or 'the file'} is missing or empty; give {allowed}")
        return FileFormatError(f"{self.file}: {self.place or 'the file'} is {quoted(self.value)}; give {allowed}")

    def refused(self, words: str) -> FileFormatError:
        """The complaint that it is something else than what can be had."""
        return FileFormatError(f"{self.file}: {self.place or 'the file'} {words}")

    def table(self) -> dict[str, Any]:
        """A table, empty where there is nothing."""
        if self.value is None:
            return {}
        if not isinstance(self.value, dict):
            raise self.wrong("a table")
        return self.value

    def at(self, *keys: str) -> Node:
        """What stands under keys, one below the other; nothing where one of them is not there."""
        found = self
        for key in keys:
            place = f"{found.place}.{key}" if found.place else key
            found = Node(found.table().get(key), self.file, self.what, place)
        return found

    def items(self) -> list[Node]:
        """The entries of a list, none where there is nothing."""
        if self.value is None:
            return []
        if not isinstance(self.value, list):
            raise self.wrong("a list")
        return [Node(v, self.file, self.what, f"{self.place}[{i}]") for i, v in enumerate(self.value)]

    def known(self, names: Sequence[str]) -> None:
        """Refuses keys that are none of a message's: misspelt, they would count as absent."""
        for key in self.table():
            if key not in names:
                place = f"{self.place}.{cut(str(key))}" if self.place else cut(str(key))
                raise FileFormatError(
                    f"{self.file}: {place} is not of a {self.what}{nearest(str(key), names)}; known there are "
                    f"{cut(', '.join(names), MOST_NAMES)}"
                )

    def text(self) -> str:
        """A name."""
        if not isinstance(self.value, str) or not self.value.strip():
            raise self.wrong("a name")
        return self.value

    def number(self, allowed: str = "a finite number") -> float:
        """A finite number."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
            raise self.wrong(allowed)
        return float(value)

    def numbers(self, names: str, allowed: str) -> Array:
        """Numbers, as a list or as a table with a key for each letter of ``names``."""
        if isinstance(self.value, dict):
            self.known(tuple(names))
            return np.array([self.at(name).number(f"{allowed}, finite") for name in names])
        if not isinstance(self.value, list) or len(self.value) != len(names):
            raise self.wrong(allowed)
        return np.array([item.number(f"{allowed}, finite") for item in self.items()])

    def pose(self) -> pin.SE3:
        """A pose: position [m] and quaternion x, y, z, w; none is the identity."""
        self.known(("position", "orientation"))
        return self._placement("position", "orientation")

    def transform(self) -> pin.SE3:
        """A transform: translation [m] and quaternion x, y, z, w; none is the identity."""
        self.known(("translation", "rotation"))
        return self._placement("translation", "rotation")

    def _placement(self, where: str, turned: str) -> pin.SE3:
        position, rotation = self.at(where), self.at(turned)
        translation = np.zeros(3) if position.value is None else position.numbers("xyz", "three numbers x, y, z [m]")
        if rotation.value is None:
            return pin.SE3(np.eye(3), translation)
        xyzw = rotation.numbers("xyzw", "four numbers x, y, z, w")
        if not abs(np.linalg.norm(xyzw) - 1.0) <= UNIT:
            raise rotation.wrong("a quaternion x, y, z, w of norm one")
        x, y, z, w = xyzw / np.linalg.norm(xyzw)
        return pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), translation)


def read_message(path: str | Path, what: str) -> Node:
    """The message of a YAML file; ``what`` says what it should be."""
    text, name = read_text(path, what).removeprefix("\ufeff"), cut(str(path), LONGEST_PATH)
    try:
        documents = [document for document in yaml.load_all(text, Loader=LOADER) if document is not None]
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise FileFormatError(f"{name} is not a {what}: not YAML ({cut(' '.join(str(error).split()), 200)})") from error
    if len(documents) != 1 or not isinstance(documents[0], dict):
        found = "no table" if documents else "empty"
        raise FileFormatError(f"{name} is not a {what}: it is {found if len(documents) < 2 else 'several documents'}")
    return Node(documents[0], name, what)
