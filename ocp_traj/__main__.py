"""``python -m ocp_traj`` is the command ``ocp-traj``."""

from ocp_traj.cli import main

if __name__ == "__main__":
    main()
