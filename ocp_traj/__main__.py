"""``python -m ocp_traj`` and the ``ocp-traj`` script: from the first line on, Ctrl-C ends it without a traceback.

To import the command line takes a second or more, so what it needs is imported once signals are obeyed.
"""

import sys

from ocp_traj import stopping
from ocp_traj.cli import standard_streams


def main() -> None:
    """Entry point of the ``ocp-traj`` script."""
    stopping.obey_signals()
    standard_streams.repair()
    from ocp_traj.cli.commands import run

    code = run()
    stopping.ignore_signals()
    sys.exit(code)


if __name__ == "__main__":
    main()
