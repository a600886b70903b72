"""Which bodies may touch: links with what is around them, and links with links that are no neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.errors import FileFormatError, quoted
from ocp_traj.files import LONGEST_PATH, read_text
from ocp_traj.robot.bodies import Body
from ocp_traj.robot.pair_distances import PairDistances
from ocp_traj.robot.robot import Robot
from ocp_traj.robot.urdf import description_root

POSTURES = 256  # at which pairs that touch at every one are looked for: our choice
SEED = 0
MOSTLY = 0.5  # share of the postures from which on links that overlap are left out: our choice
BEYOND = np.pi  # [rad or m] range of a joint without limits on its position

Links = frozenset[frozenset[str]]  # pairs of names


@dataclass(frozen=True)
class BodyPairs:
    """Pairs of indices among bodies, and those that were left out.

    Attributes:
        pairs: to be kept apart.
        touching: pairs of links that overlap at every posture tried, or at most of them.
        disabled: pairs of links left out on request.
    """

    pairs: tuple[tuple[int, int], ...]
    touching: tuple[tuple[str, str], ...] = ()
    disabled: tuple[tuple[str, str], ...] = ()


def obstacle_pairs(bodies: Sequence[Body], obstacles: Iterable[int]) -> tuple[tuple[int, int], ...]:
    """Every body that moves with each obstacle: indices among ``bodies``, which holds both."""
    around = list(obstacles)
    return tuple((i, j) for i, body in enumerate(bodies) if i not in around and body.joint > 0 for j in around)


def self_pairs(
    robot: Robot, bodies: Sequence[Body], links: Iterable[int] | None = None, disabled: Links = frozenset(),
    postures: int = POSTURES,
) -> BodyPairs:  # fmt: skip
    """Pairs of bodies of a robot that move against each other and are no neighbours.

    Neighbours are on one joint, or on one and that before it; locked joints are none, so that what hangs on either side
    of a moving joint is left out, whatever is fixed in between.

    Args:
        robot: whose bodies they are.
        bodies: of links and, it may be, surroundings.
        links: indices of those that count; None for all.
        disabled: pairs of links to leave out, as ``disabled_collisions`` reads them.
        postures: seeded, within the joints' limits. Pairs of links that overlap at most of them are left out: they are
            so near one another that the bodies about them tell nothing of the links.
    """
    chosen = list(range(len(bodies)) if links is None else links)
    parents = list(robot.model.parents)
    disabled_found: dict[tuple[str, str], None] = {}
    pairs: list[tuple[int, int]] = []
    for place, i in enumerate(chosen):
        for j in chosen[place + 1 :]:
            one, two = bodies[i].joint, bodies[j].joint
            names = bodies[i].link, bodies[j].link
            if one == two or one == parents[two] or two == parents[one]:
                continue
            if frozenset(names) in disabled:
                disabled_found[names] = None
            else:
                pairs.append((i, j))
    never = _touching(robot, bodies, pairs, postures)
    kept = tuple(pair for pair in pairs if (bodies[pair[0]].link, bodies[pair[1]].link) not in never)
    return BodyPairs(kept, tuple(never), tuple(disabled_found))


def disabled_collisions(path: str | Path) -> Links:
    """Pairs of links of an SRDF's ``disable_collisions``."""
    text = read_text(path, "SRDF")
    origin = quoted(str(path), LONGEST_PATH)
    root = description_root(text, origin, "an SRDF", FileFormatError)
    found = set()
    for element in root.iter("disable_collisions"):
        names = element.get("link1"), element.get("link2")
        if names[0] is None or names[1] is None:
            raise FileFormatError(f"{origin}: a disable_collisions names {names}; give link1 and link2")
        found.add(frozenset((names[0], names[1])))
    return frozenset(found)


def _touching(
    robot: Robot, bodies: Sequence[Body], pairs: Sequence[tuple[int, int]], postures: int
) -> dict[tuple[str, str], None]:
    """Pairs of links that overlap at most postures, in order."""
    if not pairs or postures < 1:
        return {}
    names = [(bodies[i].link, bodies[j].link) for i, j in pairs]
    distinct = list(dict.fromkeys(names))
    row_of: Index = np.array([distinct.index(name) for name in names])
    distances, q = PairDistances(robot, [(bodies[i], bodies[j]) for i, j in pairs]), random_postures(robot, postures)
    at, rows = np.nonzero(distances.at_least(q) < 0.0)
    met = distances.distances(q[at], rows) < 0.0
    overlap = np.zeros((len(distinct), postures), dtype=bool)
    overlap[row_of[rows[met]], at[met]] = True
    return {name: None for name, row in zip(distinct, overlap, strict=True) if row.mean() >= MOSTLY}


def random_postures(robot: Robot, count: int, seed: int = SEED) -> Array:
    """Postures ``(count, n)`` within the limits on position, or within half a turn where there are none."""
    low, high = np.full(robot.size, -BEYOND), np.full(robot.size, BEYOND)
    if robot.limits.position is not None:
        given_low, given_high = np.broadcast_to(np.asarray(robot.limits.position, dtype=float), (2, robot.size))
        known = np.isfinite(given_low) & np.isfinite(given_high) & (given_high - given_low < 1e3)
        low, high = np.where(known, given_low, low), np.where(known, given_high, high)
    return np.random.default_rng(seed).uniform(low, high, size=(count, robot.size))
