"""The command line: ``ocp-traj``, also ``python -m ocp_traj``.

Results go to stdout, as tables or, with ``--json``, as one JSON object; progress and messages go to stderr. Exit codes:
0 done and proved; 1 the result is infeasible, violated or undecided, or cannot be written; 2 wrong input, in one line;
130, 143 and 129 ended by Ctrl-C, SIGTERM and SIGHUP.

One of these signals ends ``solve``, ``pareto``, ``resume`` and ``payload`` within the time of an iteration of IPOPT or
of a generation: what has been found is shown and written, and one line on stderr says what was left undone. Any other
command, and the second signal anywhere, ends at once. No file is ever half written.

To import what solves, draws and proves takes seconds: each command imports what it needs, in its body.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import typer
from typer.exceptions import TyperException

# Each registers its commands, in the order in which help lists them.
from ocp_traj.cli import console, task_commands, solve_commands, front_commands, result_commands  # isort: skip
from ocp_traj.cli.app import DONE, NOT_PROVED, WRONG_INPUT, app
from ocp_traj.errors import InputError, OcpTrajError, cut
from ocp_traj.files import LONGEST_PATH

GROUPS = (task_commands, solve_commands, front_commands, result_commands)
LONGEST_USAGE = 500  # of a message about options [characters]: our choice


def run(arguments: Sequence[str] | None = None) -> int:
    """Runs a command line and returns its exit code; errors become one line on stderr."""
    try:
        code = _run(arguments)
        if sys.stdout is not None:
            sys.stdout.flush()  # else Python finds at exit that it cannot, with a traceback
    except OSError as error:
        if error.filename is not None:
            console.say(f"error: {cut(str(error.filename), LONGEST_PATH)}: {error.strerror}")
            return WRONG_INPUT
        sys.stdout = open(os.devnull, "w")  # what could not be written is not tried again at exit
        console.say(f"error: cannot write the result: {error.strerror or error}")
        return NOT_PROVED
    return code


def _run(arguments: Sequence[str] | None) -> int:
    command: Callable[..., Any] = typer.main.get_command(app)
    try:
        result = command(
            args=None if arguments is None else list(arguments), prog_name="ocp-traj", standalone_mode=False
        )
    except OcpTrajError as error:
        code = WRONG_INPUT if isinstance(error, InputError) else NOT_PROVED
        if "--json" in (sys.argv[1:] if arguments is None else arguments):
            console.show(
                console.Sheet({"error": cut(str(error), console.LONGEST_MESSAGE), "exit_code": code}, []), json=True
            )
        console.say(f"error: {error}")
        return code
    except typer.Exit as stop:
        return int(stop.exit_code)
    except MemoryError:
        console.say("error: this machine has not enough memory for that; ask for less")
        return NOT_PROVED
    except TyperException as error:  # of options and arguments
        words = error.format_message()
        if words:
            console.say(f"error: {cut(' '.join(words.split()), LONGEST_USAGE)}; see ocp-traj --help")
        return WRONG_INPUT
    return result if isinstance(result, int) else DONE
