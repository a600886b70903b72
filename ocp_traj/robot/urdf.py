"""Reads a URDF far enough to say in one line what is wrong with it; pinocchio does the rest."""

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from ocp_traj.errors import FileFormatError, RobotDefinitionError, quoted
from ocp_traj.files import LONGEST_PATH, read_text

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def urdf_text(source: str | Path) -> tuple[str, str]:
    """The XML and what to call it in messages."""
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return source, "the URDF string"
    try:
        return read_text(source, "URDF"), quoted(str(source), LONGEST_PATH)
    except FileFormatError as error:
        raise RobotDefinitionError(f"{error}; give a path, or the XML itself") from error


def urdf_root(text: str, origin: str) -> ElementTree.Element:
    """The root element, checked to be a robot and no xacro."""
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RobotDefinitionError(f"{origin} is not a URDF: it is not XML ({error})") from error
    if root.tag != "robot":
        raise RobotDefinitionError(f"{origin} is not a URDF: its root is <{root.tag}>, expected <robot>")
    if any("xacro" in element.tag for element in root.iter()):
        raise RobotDefinitionError(f"{origin} is a xacro file, not a URDF; run xacro on it first")
    for link in root.iter("link"):
        for part in link.iter("inertial"):
            _check_inertial(part, f"link {link.get('name')!r} of {origin}")
    return root


def _check_inertial(part: ElementTree.Element, where: str) -> None:
    """Refuses what the reader would drop with a word on stderr, leaving a link without mass."""
    mass, inertia = part.find("mass"), part.find("inertia")
    if mass is None or inertia is None:
        raise RobotDefinitionError(f"{where}: its inertial needs both a mass and an inertia")
    numbers = {"mass": mass.get("value")} | {name: inertia.get(name, "0") for name in MOMENTS}
    for name, text in numbers.items():
        try:
            value = float(text or "")
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or (value < 0.0 and name in ("mass", "ixx", "iyy", "izz")):
            raise RobotDefinitionError(
                f"{where}: its {name} is {text!r}; give a finite number, zero or more on the diagonal"
            )
