"""The page on which a front is looked at: one HTML file that needs nothing else."""
