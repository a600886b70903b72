"""What the distances of many pairs of bodies are at least, quickly: of a ball about one from the other.

Of what is fixed in the world that is the signed distance of the ball's centre from the other's box: a thin wall is not
taken for a large ball. Of two bodies that move it is that of their balls.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ocp_traj.arrays import Array, Index
from ocp_traj.robot.bodies import Body
from ocp_traj.robot.signed_distance import outside_box

CHUNK = 200_000  # pairs at postures at once: the arrays stay in the processor's cache


class PairBounds:
    """Lower bounds on the distances of pairs.

    Args:
        pairs: of bodies; of a half-space it is the second.
        carriers: indices of the joints that carry them, in the order in which placements are given.
    """

    def __init__(self, pairs: Sequence[tuple[Body, Body]], carriers: Index) -> None:
        """Puts the numbers of all bodies in arrays."""
        bodies = list({id(body): body for pair in pairs for body in pair}.values())
        number = {id(body): i for i, body in enumerate(bodies)}
        self._count = len(pairs)
        self._carrier = np.searchsorted(carriers, [body.joint for body in bodies])
        self._centre = np.array([body.centre for body in bodies]).reshape(-1, 3)
        reach = np.array([np.linalg.norm(body.half) + body.radius for body in bodies])
        a, b = np.array([[number[id(body)] for body in pair] for pair in pairs], dtype=np.intp).reshape(-1, 2).T
        fixed = np.array([body.joint == 0 for _, body in pairs], dtype=bool)
        unbounded = np.array([np.isinf(body.half).any() for _, body in pairs], dtype=bool)
        self._balls, self._walls = np.flatnonzero(~fixed & ~unbounded), np.flatnonzero(fixed & ~unbounded)
        self._planes = np.flatnonzero(unbounded)
        self._first, self._second = a, b
        self._reach = reach[a] + np.where(np.isfinite(reach[b]), reach[b], 0.0)
        radius = np.array([body.radius for body in bodies])
        self._reach[self._walls] = (reach[a] + radius[b])[self._walls]
        self._reach[self._planes] = (reach[a] + radius[b])[self._planes]
        # Of what does not move: x in its axes is turn^T (x - centre).
        walls, planes = ([pairs[i][1] for i in some.tolist()] for some in (self._walls, self._planes))
        self._turn = np.array([body.axes for body in walls]).reshape(-1, 3, 3)
        self._half = np.array([body.half for body in walls]).reshape(-1, 3)
        self._normal = np.array([body.normal for body in planes]).reshape(-1, 3)

    def __call__(self, rotations: Array, places: Array) -> Array:
        """Bounds ``(N, pairs)`` where the carriers are turned ``(N, joints, 3, 3)`` and placed ``(N, joints, 3)``."""
        found = np.empty((len(rotations), self._count))
        step = max(1, CHUNK // max(self._count, 1))
        for i in range(0, len(rotations), step):
            self._put(found[i : i + step], rotations[i : i + step], places[i : i + step])
        found -= self._reach
        return found

    def _put(self, found: Array, rotations: Array, places: Array) -> None:
        own = self._carrier
        centres = np.einsum("nbij,bj->nbi", rotations[:, own], self._centre) + places[:, own]
        apart = centres[:, self._first] - centres[:, self._second]
        found[:, self._balls] = np.sqrt(np.einsum("npi,npi->np", apart[:, self._balls], apart[:, self._balls]))
        local = np.einsum("pij,npi->npj", self._turn, apart[:, self._walls])
        found[:, self._walls] = outside_box(local, self._half)
        if len(self._planes):
            carrier = own[self._second[self._planes]]
            normal = np.einsum("npij,pj->npi", rotations[:, carrier], self._normal)
            found[:, self._planes] = (apart[:, self._planes] * normal).sum(axis=2)
