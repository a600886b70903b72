"""Robots by name: the URDFs of the package ``example-robot-data`` (extra ``robots``), and where ROS packages lie."""

import re
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from ocp_traj.errors import MOST_NAMES, RobotDefinitionError, UnknownName, cut, nearest, quoted
from ocp_traj.files import LONGEST_PATH
from ocp_traj.robot.urdf import urdf_root, urdf_text

PACKAGE = "example-robot-data"
SHARE = "share/example-robot-data/robots"
# Names of the package's loaders that are neither a file's nor, for a folder with one file, a folder's.
LOADERS = {
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "anymal_kinova": "anymal_b_simple_description/robots/anymal-kinova.urdf",
    "b1_z1": "b1_description/urdf/b1-z1.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "iris": "iris_description/robots/iris_simple.urdf",
    "solo8": "solo_description/robots/solo.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
    "talos_box": "talos_data/robots/talos_reduced_box.urdf",
    "talos_full": "talos_data/robots/talos_full_v2.urdf",
    "talos_full_box": "talos_data/robots/talos_full_v2_box.urdf",
    **{name: f"ur_description/urdf/{name}_robot.urdf" for name in ("ur3", "ur5", "ur10")},
    **{f"{name}_limited": f"ur_description/urdf/{name}_joint_limited_robot.urdf" for name in ("ur3", "ur5", "ur10")},
}


def descriptions() -> dict[str, Path]:
    """The URDF of every name: a loader's, a file's, or that of a folder with one file; sorted.

    Raises ``RobotDefinitionError`` where the package is not installed.
    """
    places = [Path(sys.prefix) / SHARE]  # where Conda and Debian have it
    with suppress(PackageNotFoundError):
        places.insert(0, Path(str(distribution(PACKAGE).locate_file(f"cmeel.prefix/{SHARE}"))))
    folder = next((place for place in places if place.is_dir()), None)
    if folder is None:
        raise RobotDefinitionError(
            f"robots by name come from the package {PACKAGE}, which is not installed; "
            "pip install 'ocp-traj[robots]', or give a URDF"
        )
    files = sorted(folder.glob("*/*/*.urdf"))
    folders = [file.parent.parent for file in files]
    alone = {place.name.removesuffix("_description"): file for place, file in zip(folders, files, strict=True)
             if folders.count(place) == 1}  # fmt: skip
    loaders = {name: folder / path for name, path in LOADERS.items() if (folder / path).is_file()}
    return dict(sorted((alone | {file.stem: file for file in files} | loaders).items()))


def description_urdf(name: str) -> Path:
    """The URDF of a robot of ``example-robot-data``, by a name of `descriptions`."""
    known = descriptions()
    if name not in known:
        raise UnknownName(
            f"{quoted(name)} is no robot of {PACKAGE}{nearest(name, known)}; "
            f"known are {cut(', '.join(known), 4 * MOST_NAMES)}"
        )
    return known[name]


def package_folders(urdf: str | Path, part: str = "robot") -> list[Path]:
    """Folders that hold the packages which a URDF's meshes name as ``package://NAME/..``, as pinocchio asks for them.

    Searched upward from the URDF's own folder, as packages lie in a ROS workspace.  A package that is not there raises
    ``RobotDefinitionError``.

    Args:
        urdf: the file.
        part: elements whose meshes count, such as ``collision``.
    """
    text, origin = urdf_text(Path(urdf))
    parts = urdf_root(text, origin).iter(part)
    names = [mesh.get("filename", "") for element in parts for mesh in element.iter("mesh")]
    packages = {match[1] for name in names if (match := re.match(r"package:/*([^/]+)/", name))}
    above = Path(urdf).resolve().parents
    folders: list[Path] = []
    for package in sorted(packages):
        holding = next((folder for folder in above if (folder / package).is_dir()), None)
        if holding is None:
            raise RobotDefinitionError(
                f"package {quoted(package)} of {origin} is in no folder above {cut(str(above[0]), LONGEST_PATH)}; "
                "put the URDF into its package, as in a ROS workspace"
            )
        if holding not in folders:
            folders.append(holding)
    return folders
