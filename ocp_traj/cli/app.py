"""The application that all commands belong to, and its exit codes."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ocp_traj.cli import console
from ocp_traj.version import __version__

DONE, NOT_PROVED, WRONG_INPUT = 0, 1, 2


class _Commands(TyperGroup):
    """The commands; one that is interrupted says so, which typer would not."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            return console.interrupted("before there was a result")


app = typer.Typer(
    cls=_Commands,
    add_completion=False,
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def start(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> int:
    """Robot trajectories that are optimal and proved to keep every limit at every instant.

    Exit codes: 0 done and proved; 1 infeasible, violated, undecided, or not written; 2 wrong input; 130, 143, 129 ended
    by Ctrl-C, SIGTERM, SIGHUP, with what had been found until then.
    """
    if version:
        print(f"ocp-traj {__version__}")
        raise typer.Exit(DONE)
    if context.invoked_subcommand is None:
        print(context.get_help())
        raise typer.Exit(WRONG_INPUT)
    return DONE
