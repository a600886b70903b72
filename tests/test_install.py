"""An install works from the repository root and from elsewhere, be it editable or plain."""

import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGES = ("ocp_traj", "problems", "solvers")
WHERE_IMPORTED = """
import ocp_traj, ocp_traj.problems, ocp_traj.solvers
for module in (ocp_traj, ocp_traj.problems, ocp_traj.solvers):
    print(module.__file__)
"""


@dataclass(frozen=True)
class Install:
    kind: str
    root: Path  # the copy of the checkout it was made from
    elsewhere: Path
    python: Path
    site_packages: Path

    def run(self, command: Sequence[str | Path], cwd: Path) -> str:
        """What the command prints; its whole output is in the failure if it fails."""
        hidden = {"PYTHONPATH", "PYTHONHOME", "PYTHONSAFEPATH", "PIP_TARGET", "PIP_PREFIX", "PIP_USER"}
        environment = {key: value for key, value in os.environ.items() if key not in hidden}
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, f"{command} in {cwd}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def folder(self, where: str) -> Path:
        return self.root if where == "root" else self.elsewhere

    def packages(self, where: str) -> list[Path]:
        """Where the three packages come from: a checkout hides, from its root, an installed package."""
        if self.kind == "editable" or where == "root":
            return [self.root / name for name in PACKAGES]
        top = self.site_packages / "ocp_traj"
        return [top, top / "problems", top / "solvers"]


@pytest.fixture(scope="module", params=["editable", "plain"])
def install(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Install:
    """The package in an environment of its own, which borrows the dependencies of the running one."""
    base = tmp_path_factory.mktemp(request.param)
    root, elsewhere, environment = base / "checkout", base / "elsewhere", base / "venv"
    root.mkdir()
    elsewhere.mkdir()
    for file in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(CHECKOUT / file, root)
    for package in PACKAGES:
        shutil.copytree(CHECKOUT / package, root / package, ignore=shutil.ignore_patterns("__pycache__"))

    venv.create(environment, with_pip=False, symlinks=True)
    python = environment / "bin" / "python"
    site_packages = environment / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"
    # Bare folders, not site directories: the hooks of an editable install of the real checkout must not come along.
    borrowed = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    (site_packages / "borrowed.pth").write_text("\n".join(borrowed) + "\n")

    made = Install(request.param, root, elsewhere, python, site_packages)
    # --ignore-installed: the borrowed environment may hold the package too, and keeps it.
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", str(python)]
    options = ["--no-deps", "--no-index", "--no-build-isolation", "--ignore-installed"]
    editable = ["--editable"] if made.kind == "editable" else []
    made.run([*pip, "install", *options, *editable, str(root)], cwd=base)
    return made


@pytest.mark.parametrize("where", ["root", "elsewhere"])
def test_problems_and_solvers_import(install: Install, where: str) -> None:
    files = install.run([install.python, "-c", WHERE_IMPORTED], cwd=install.folder(where)).splitlines()
    assert [Path(file) for file in files] == [package / "__init__.py" for package in install.packages(where)]


@pytest.mark.parametrize("where", ["root", "elsewhere"])
@pytest.mark.parametrize("command", ["module", "script"])
def test_command_line_answers(install: Install, command: str, where: str) -> None:
    start = [install.python, "-m", "ocp_traj"] if command == "module" else [install.python.with_name("ocp-traj")]
    assert "pareto" in install.run([*start, "--help"], cwd=install.folder(where))


def test_one_top_level_name_is_claimed(install: Install) -> None:
    ours = {path.name for path in install.site_packages.iterdir()} - {"borrowed.pth", "__pycache__"}
    names = {name for name in ours if not name.startswith("__editable__") and not name.endswith(".dist-info")}
    assert names == (set() if install.kind == "editable" else {"ocp_traj"})
    claimed = install.run(
        [
            install.python,
            "-c",
            "from importlib.metadata import distribution; print(distribution('ocp-traj').read_text('top_level.txt'))",
        ],
        cwd=install.elsewhere,
    )
    assert claimed.split() == ["ocp_traj"]


def test_types_and_every_module_of_every_room_are_shipped(install: Install) -> None:
    """Each is importable as the name its place in the checkout gives it, and comes from where it was installed to."""
    package = install.packages("elsewhere")[0]
    assert (package / "py.typed").is_file()
    parts = [path.name for path in (install.root / "ocp_traj" / "report" / "static").iterdir()]
    assert parts and all((package / "report" / "static" / name).is_file() for name in parts)  # of the page
    modules = {}
    for name, package in zip(PACKAGES, install.packages("elsewhere"), strict=True):
        for path in (install.root / name).rglob("*.py"):
            relative = path.relative_to(install.root / name)
            parts = [part for part in relative.with_suffix("").parts if part != "__init__"]
            modules[".".join(["ocp_traj", *([] if name == "ocp_traj" else [name]), *parts])] = package / relative
    listing = f"from importlib.util import find_spec; [print(m, find_spec(m).origin) for m in {list(modules)}]"
    found = install.run([install.python, "-c", listing], cwd=install.elsewhere).splitlines()
    assert {name: Path(file) for name, file in (line.split() for line in found)} == modules
    assert {name.split(".")[1] for name in modules if name.count(".") > 1} >= {"curves", "proof", "problems", "solvers"}
    if install.kind == "plain":
        shipped = {path for path in install.packages("elsewhere")[0].rglob("*.py")}
        assert shipped == set(modules.values())
