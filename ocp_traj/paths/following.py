"""Postures along a tool path: continuation from a posture, and the branch that is best over the whole path.

Where an arm cannot follow, the place along the path and the reason are told: out of reach, beyond a joint's range, or
too near a singular posture, where the tool cannot move some way whatever the joints do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from ocp_traj.arrays import Array
from ocp_traj.errors import InputError
from ocp_traj.paths.cartesian import ToolPath
from ocp_traj.robot.inverse_kinematics import InverseKinematics

SINGULAR = 0.01  # [m, rad] least singular value of the tool's Jacobian that a path may have: our choice, as all here
STEP = 0.1  # [rad or m] of a joint from one posture to the next, at most; halved until it is
NARROWEST = 1e-5  # of the path's length: a step that small that is still too far is a jump
MOST_BRANCHES = 12  # from which a path is tried
CLOSE_BY = 1e-3  # [m, rad] by which a pose is missed, and below which the arm's reach is said to end there
HALVINGS = 20  # in the search for a singular place
SAMPLES = 9  # of a path at least, ends included


class Unreachable(InputError):
    """A place of a tool path that an arm does not reach, or not well."""

    share = 0.0  # of the path that is reached

    @classmethod
    def on(cls, path: ToolPath, s: float, reason: str) -> Unreachable:
        """The place at a length of path [m] and the reason, in words."""
        x, y, z = (round(float(c), 6) + 0.0 for c in path.at(s).translation)
        found = cls(f"at {s:.4g} m of {path.length:.4g} m along it, at ({x:.4g}, {y:.4g}, {z:.4g}) m: {reason}")
        found.share = s / path.length
        return found


@dataclass(frozen=True, eq=False)
class Followed:
    """Postures along a tool path.

    Attributes:
        s: lengths of path ``(N,)`` [m], ascending, ends included.
        q: postures ``(N, n)``.
        least: smallest singular value of the Jacobian that was found.
        least_at: length of path where [m].
        branch: which of how many was chosen, for people; empty where the start was given.
    """

    s: Array
    q: Array
    least: float
    least_at: float
    branch: str = ""

    def at(self, places: Array, ik: InverseKinematics, path: ToolPath) -> Array:
        """Postures ``(M, n)`` at lengths of path ``(M,)`` [m], each from those known, which are joined smoothly.

        What an arm with a joint to spare does besides is what it does on the way from one known posture to the next:
        reached from the nearest one alone it would jump midway between two.
        """
        rows = []
        for s, near in zip(places, CubicSpline(self.s, self.q)(places), strict=True):
            reached = ik.reach(path.at(float(s)), near)
            if not reached.found:
                raise Unreachable.on(path, float(s), _reason(ik, path, float(s), near))
            rows.append(reached.q)
        return np.array(rows)


def follow(ik: InverseKinematics, path: ToolPath, start: Array) -> Followed:
    """Postures along a path from the posture ``start (n,)`` at its beginning.

    Raises:
        Unreachable: with the place and the reason.
    """
    places, postures = [0.0], [ik.reach(path.at(0.0), start).q]
    ahead = np.linspace(0.0, path.length, max(SAMPLES, 4 * len(path.sections) + 1))[:0:-1].tolist()
    while ahead:
        s, here, q = ahead[-1], places[-1], postures[-1]
        guess = q
        if len(places) > 1 and here - places[-2] > 0.0:
            guess = q + (q - postures[-2]) * min(2.0, (s - here) / (here - places[-2]))
        reached = ik.reach(path.at(s), guess)
        if reached.found and np.abs(reached.q - q).max() <= STEP:
            places.append(s)
            postures.append(reached.q)
            ahead.pop()
        elif s - here > NARROWEST * path.length:
            ahead.append((s + here) / 2.0)
        elif reached.found or (again := ik.reach(path.at(s), q)).found and np.abs(again.q - q).max() > STEP:
            raise Unreachable.on(path, s, "a singular posture, past which the joints would have to jump")
        else:
            raise Unreachable.on(path, s, _reason(ik, path, s, q))
    s_, q_ = np.array(places), np.array(postures)
    least, at = _least_singular(ik, path, s_, q_)
    if least < SINGULAR:
        raise Unreachable.on(
            path, at, f"a singular posture: the least singular value of the tool's Jacobian is {least:.2g}, less than "
            f"{SINGULAR:g} (m and rad alike); the tool can hardly move some way there"
        )  # fmt: skip
    return Followed(s_, q_, least, at)


def best_branch(ik: InverseKinematics, path: ToolPath, rng: np.random.Generator, speeds: Array) -> Followed:
    """Postures along a path whose beginning leaves the branch open: that which takes the least time, by joint speeds.

    Args:
        ik: of the arm.
        path: to follow.
        rng: of the starts from which branches are looked for.
        speeds: of the joints ``(n,)`` [rad/s or m/s], infinite where not limited.
    """
    branches = ik.branches(path.at(0.0), rng)
    if not branches:
        raise Unreachable.on(path, 0.0, _reason(ik, path, 0.0, np.clip(np.zeros(ik.robot.size), *ik.ranges)))
    found: list[tuple[float, Followed]] = []
    failures: list[Unreachable] = []
    tried = branches[:MOST_BRANCHES]
    for branch in tried:
        try:
            followed = follow(ik, path, branch)
        except Unreachable as error:
            failures.append(error)
        else:
            found.append((_time(followed.q, speeds), followed))
    if not found:
        farthest = max(failures, key=lambda error: error.share)
        raise farthest
    best = min(range(len(found)), key=lambda i: found[i][0])
    chosen = found[best][1]
    words = f"the quickest of {len(found)} that hold all along it, {len(tried)} were tried"
    return Followed(chosen.s, chosen.q, chosen.least, chosen.least_at, words)


def _time(q: Array, speeds: Array) -> float:
    """Of a path through postures ``(N, n)`` at the joints' speeds, or its length where they are not limited."""
    steps = np.abs(np.diff(q, axis=0)) / np.where(np.isfinite(speeds), speeds, 1.0)
    return float(steps.max(axis=1).sum())


def _least_singular(ik: InverseKinematics, path: ToolPath, s: Array, q: Array) -> tuple[float, float]:
    """The smallest singular value along postures and where, looked for between them too.

    Where it falls below the bound it is the place at which that happens first.
    """
    values = np.array([ik.least_singular_value(row) for row in q])

    def at(place: float, near: Array) -> float:
        reached = ik.reach(path.at(place), near)
        return ik.least_singular_value(reached.q) if reached.found else 0.0

    i = int(np.argmin(values))
    if values[i] < SINGULAR:
        i = int(np.argmax(values < SINGULAR))
        if i == 0:
            return float(values[0]), float(s[0])
        good, bad = float(s[i - 1]), float(s[i])
        for _ in range(HALVINGS):
            middle = (good + bad) / 2.0
            good, bad = (middle, bad) if at(middle, q[i - 1]) >= SINGULAR else (good, middle)
        return at(bad, q[i]), bad
    bounds = s[max(i - 1, 0)], s[min(i + 1, len(s) - 1)]
    found = minimize_scalar(
        lambda place: at(place, q[i]), bounds=bounds, method="bounded", options={"maxiter": HALVINGS}
    )
    return (float(found.fun), float(found.x)) if found.fun < values[i] else (float(values[i]), float(s[i]))


def _reason(ik: InverseKinematics, path: ToolPath, s: float, near: Array) -> str:
    """Why an arm does not reach a place of a path."""
    target = path.at(s)
    free, kept = ik.reach(target, near, ranged=False), ik.reach(target, near)
    if free.found:
        low, high = ik.ranges
        worst = int(np.argmax(np.maximum(free.q - high, low - free.q)))
        joint, bound = ik.robot.joints[worst], high[worst] if free.q[worst] > high[worst] else low[worst]
        unit = ik.robot.units[worst]
        return (
            f"{joint} would have to go to {free.q[worst]:.4g} {unit}, beyond its range, which ends at {bound:.4g} "
            f"{unit}; begin from another posture, or elsewhere"
        )
    nearest = f"it comes within {kept.error:.3g} (m, rad) of it" if kept.error > CLOSE_BY else "its reach ends here"
    return f"out of the arm's reach: {nearest} on this branch of postures; bring the path nearer, or turn the tool"
