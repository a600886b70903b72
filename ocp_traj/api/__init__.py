"""What most users call: solve, pareto and payload, the solvers composed with sensible defaults."""
