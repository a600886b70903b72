"""A task built in code, with a limit and an objective of one's own: the tool's speed, and the heat of the motors."""

import casadi

import ocp_traj as ot

TASK = ot.Task(
    name="ur5-slow-tool",
    robot={"description": "ur5", "tool_frame": "tool0", "payload": {"mass": 3.0, "com": [0.0, 0.0, 0.05]}},
    limits={"acceleration": 8.0, "jerk": 60.0},
    curve={"kind": "quintic"},
    move=[{"via": [
        [0.782, -1.064, 1.456, -1.894, -1.864, -0.394], [0.252, -0.890, 1.407, -1.522, -1.836, -0.288],
        [-0.320, -2.245, 1.181, -0.963, -0.940, 0.497],
    ]}],
)  # fmt: skip


def tool_speed(s: ot.RobotState) -> casadi.SX:
    """Square of the tool's speed [m2/s2]: a norm itself has a kink at 0, which no proof passes."""
    return casadi.sumsqr(casadi.jtimes(s.position, s.q, s.v))


def build(task: ot.Task = TASK) -> ot.Problem:
    """The problem; its id is that of this function, so that commands and files find the limit again."""
    problem = ot.problems.load("task", task=task)
    problem = ot.with_limit(problem, "tool-speed", tool_speed, upper=1.0**2, unit="m2/s2")
    problem = ot.with_objective(problem, "heat", lambda s: casadi.sumsqr(s.tau / 100.0), "s", worst=4.0)
    return ot.with_id(problem, "examples.own_limit:build")


if __name__ == "__main__":
    solution = ot.solve(build())
    assert solution.trajectory is not None and solution.audit is not None
    print(round(solution.f, 4), solution.audit.explain())
