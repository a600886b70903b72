"""The machine that measures, and what it runs."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PEERS = ("toppra", "ruckig", "pymoo", "pygmo", "rockit-meco", "crocoddyl", "coal", "ompl")
LIBRARIES = ("casadi", "numpy", "scipy", "pin")


def processor() -> str:
    """Name of the processor."""
    cpu = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in cpu.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()


def versions(names: tuple[str, ...] = (*LIBRARIES, *PEERS)) -> str:
    """Of the packages that are there; the others are said to be missing."""
    found = []
    for name in names:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} is not installed")
    return ", ".join(found)


def commit_of(folder: Path) -> str:
    """Short name of the commit that a folder is at, with a word where it has been changed since."""
    words = ["git", "-C", str(folder)]
    name = subprocess.run([*words, "rev-parse", "--short", "HEAD"], capture_output=True, text=True).stdout.strip()
    changed = subprocess.run([*words, "diff", "--quiet", "HEAD", "--", "*.py"], capture_output=True).returncode
    return (name or "unknown") + (", changed" if changed else "")


def machine() -> str:
    """In one sentence."""
    return f"{processor()}, {os.cpu_count()} cores; Python {platform.python_version()}"
