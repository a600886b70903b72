"""From a published problem to a proved Pareto front in a few lines; the README shows what it prints."""

import ocp_traj as ot

problem = ot.problems.load("hybrid-spline", payload=8.0)
solution = ot.solve(problem, weights={"time": 0.5, "energy": 0.5}, starts=4, seed=0)
print(solution.status.value, {name: round(value, 3) for name, value in solution.objectives.items()})
print(solution.audit.explain())

front = ot.pareto(problem, ["time", "energy"], method="trace", points=10, seed=0)
digits = {"time [s]": 3, "energy [N2 m2/s]": 1, "margin": 3}
print(front.table[[*digits, "verdict"]].round(digits).to_string())
print("hypervolume", round(front.hypervolume().value, 4), "knee", front.knee())

worst = min((row for row in front.audit(0).rows if row.verdict == "proved"), key=lambda row: row.margin)
print(worst.limit, worst.label, round(worst.attained, 6), "of", worst.bound, worst.unit)
print("largest payload within 4 s:", round(ot.payload(problem, max_time=4.0).payload, 3), "kg")
