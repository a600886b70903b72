"""What is said of a proof, whichever command asked for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ocp_traj.cli import console
from ocp_traj.cli.app import DONE, NOT_PROVED

if TYPE_CHECKING:
    from ocp_traj.proof.verdicts import Audit


def verdict(checked: Audit, solved: bool = True) -> int:
    """Says what a proof has found; the exit code of that."""
    console.say(checked.explain())
    return DONE if checked.proved and solved else NOT_PROVED
