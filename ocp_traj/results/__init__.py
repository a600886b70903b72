"""What solvers return: trajectories, solutions, local optima, fronts."""
