"""Reads a URDF far enough to say in one line what is wrong with it; pinocchio does the rest."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from ocp_traj.errors import RobotDefinitionError


def urdf_text(source: str | Path) -> tuple[str, str]:
    """The XML and what to call it in messages."""
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return source, "the URDF string"
    path = Path(source)
    if not path.is_file():
        raise RobotDefinitionError(f"URDF file {str(path)!r} does not exist; give a path, or the XML itself")
    try:
        return path.read_text(encoding="utf-8"), repr(str(path))
    except UnicodeDecodeError as error:
        raise RobotDefinitionError(f"{str(path)!r} is not a URDF: it is not text ({error})") from error


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
    return root
