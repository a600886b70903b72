"""Each paper's tables beside ours; ``ocp_traj.reproductions.reproduce`` is the way in."""
