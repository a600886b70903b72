"""A URDF's model and limits: read far enough to say in one line what is wrong; pinocchio does the rest."""

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from sys import float_info

import numpy as np
import pinocchio as pin

from ocp_traj.errors import FileFormatError, InputError, RobotDefinitionError, UnsupportedJoint, quoted
from ocp_traj.files import LONGEST_PATH, read_text
from ocp_traj.robot.dynamics import joint_index, joint_is_revolute
from ocp_traj.robot.inertias import MOMENTS
from ocp_traj.robot.joint_limits import JointLimits

LINK = "\n(link)"  # no name in a file ends so
LIMITED = ("revolute", "prismatic", "continuous")


def urdf_model(text: str, origin: str, locked: Mapping[str, float]) -> pin.Model:
    """The model, some joints fixed at a coordinate [m or rad]; a continuous joint is a revolute one without limits."""
    root = urdf_root(text, origin)
    for element in root.iter("joint"):
        name = element.get("name")
        if element.get("type") == "fixed":
            if name in locked:
                raise RobotDefinitionError(f"joint {name!r} of {origin} is fixed and needs no lock; leave it out")
            continue
        if element.find("mimic") is not None and name not in locked:
            raise UnsupportedJoint(
                f"joint {name!r} of {origin} is a mimic joint; allowed are revolute and prismatic "
                f"joints. Lock it: locked={{{name!r}: 0.0}}"
            )
        if element.get("type") in LIMITED:
            _complete_limit(element)
    try:
        model = pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise RobotDefinitionError(
            f"{origin} is not a URDF pinocchio can read ({error}); see standard error"
        ) from error
    if not locked:
        return model
    coordinates, indices = pin.neutral(model), [joint_index(model, name) for name in locked]
    for index, (name, value) in zip(indices, locked.items(), strict=True):
        joint_is_revolute(model, index)
        if not math.isfinite(value):
            raise RobotDefinitionError(f"joint {name!r} is locked at {value}; give a finite coordinate [m or rad]")
        place = model.joints[index].idx_q
        low, high = float(model.lowerPositionLimit[place]), float(model.upperPositionLimit[place])
        if low < high and not low <= value <= high:  # 0 and 0: not given
            raise RobotDefinitionError(
                f"joint {name!r} is locked at {value:g}, and moves from {low:g} to {high:g} [m or rad] in {origin}; "
                "give a coordinate between"
            )
        coordinates[model.joints[index].idx_q] = value
    for frame in model.frames:  # pinocchio asks for frames by name, and links may have names of joints
        frame.name += LINK if frame.type == pin.FrameType.BODY else ""
    reduced = pin.buildReducedModel(model, indices, coordinates)
    for frame in reduced.frames:
        frame.name = frame.name.removesuffix(LINK)
    return reduced


def _complete_limit(joint: ElementTree.Element) -> None:
    """Writes what the reader would refuse a joint without: 0 where nothing is given, no bounds if it is continuous."""
    limit = joint.find("limit")
    limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
    for name in ("velocity", "effort"):
        limit.set(name, limit.get(name, "0"))
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
        limit.set("lower", repr(-float_info.max))
        limit.set("upper", repr(float_info.max))


def urdf_limits(model: pin.Model, origin: str, given: JointLimits) -> JointLimits:
    """The model's limits of position, velocity and effort, those that are given in place of it.

    A velocity or effort of 0, and a position between 0 and 0, is what the file does not say: it has to be given.
    """
    own = {
        "position": (model.lowerPositionLimit, model.upperPositionLimit),
        "velocity": (-model.upperVelocityLimit, model.upperVelocityLimit),
        "effort": (-model.upperEffortLimit, model.upperEffortLimit),
    }
    names = list(model.names)[1:]
    remedy = "write it there, or override it with limits= (inf: no limit)"
    wanted = {name: np.array(pair) for name, pair in own.items() if getattr(given, name) is None}
    for quantity, pair in wanted.items():
        if missing := ", ".join(repr(names[i]) for i in np.flatnonzero((pair == 0.0).all(axis=0))):
            raise RobotDefinitionError(
                f"{origin}: the {quantity} limit of {missing} is 0, which means not given; {remedy}"
            )
    try:
        return JointLimits(**wanted).overridden_by(given)
    except RobotDefinitionError as error:
        raise RobotDefinitionError(f"{origin}: {error} (joints {names}); {remedy}") from error


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
    root = description_root(text, origin, "a URDF", RobotDefinitionError)
    if any("xacro" in element.tag for element in root.iter()):
        raise RobotDefinitionError(f"{origin} is a xacro file, not a URDF; run xacro on it first")
    for link in root.iter("link"):
        for part in link.iter("inertial"):
            _check_inertial(part, f"link {link.get('name')!r} of {origin}")
    return root


def description_root(text: str, origin: str, kind: str, error: type[InputError]) -> ElementTree.Element:
    """The root element of a URDF or SRDF, ``kind`` in words, checked to be a robot; ``error`` is what refuses it."""
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as wrong:
        raise error(f"{origin} is not {kind}: it is not XML ({wrong})") from wrong
    if root.tag != "robot":
        raise error(f"{origin} is not {kind}: its root is <{root.tag}>, expected <robot>")
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
