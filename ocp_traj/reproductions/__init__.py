"""Each paper's tables beside ours; ``ocp_traj.reproduce`` is the way in."""
