"""Seams by length of arc: where two cylinders meet, or a file's points joined by quintic splines."""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from tests.independent.case import Case
from tests.independent.motion import Array

Curve = Callable[[float], Array]
FINE = 1e-12  # of the integration of arcs


@dataclass(frozen=True)
class Seam:
    """A path by its parameter, its axis of the torch, and the parameter by length of arc."""

    place: Curve
    axis: Curve
    length: float
    parameter: Callable[[float], float]

    def at(self, arcs: npt.ArrayLike) -> tuple[Array, Array]:
        """Places ``(N, 3)`` [m] and unit axes ``(N, 3)`` at lengths of arc ``(N,)`` [m]."""
        t = [self.parameter(float(s)) for s in np.clip(np.atleast_1d(arcs), 0.0, self.length)]
        axes = np.array([self.axis(x) for x in t])
        return np.array([self.place(x) for x in t]), axes / np.linalg.norm(axes, axis=1)[:, None]


def by_arc(place: Curve, axis: Curve, speed: Callable[[float], float], first: float, last: float) -> Seam:
    """A seam from ``first`` to ``last``, its length and dt/ds = 1/speed integrated by DOP853."""
    sign = np.sign(last - first)
    options = {"method": "DOP853", "rtol": FINE, "atol": FINE * abs(last - first), "max_step": abs(last - first) / 64}
    covered = solve_ivp(lambda t, s: [sign * speed(t)], (first, last), [0.0], **options)
    length = float(covered.y[0, -1])
    back = solve_ivp(lambda s, t: [sign / speed(float(t[0]))], (0.0, length), [first], dense_output=True, **options)
    return Seam(place, axis, length, lambda s: float(back.sol(s)[0]))


def tube(case: Case) -> Seam:
    """Where a brace meets a chord, written in terms of the two cylinders and their surface normals.

    The chord's axis is x: y^2 + z^2 = R^2. The brace's axis is b = (cos psi, 0, sin psi): a point of it is
    r (cos phi e + sin phi y) + t b with e = (sin psi, 0, -cos psi), and t follows from the chord, on its upper side.
    """
    big, small, psi = case["chord_radius"], case["brace_radius"], radians(case["psi"])
    along, across, side = (np.array(v) for v in ((cos(psi), 0.0, sin(psi)), (sin(psi), 0.0, -cos(psi)), (0, 1.0, 0)))
    yaw, mirror = radians(case["yaw"]), np.diag([-1.0 if case["mirrored"] else 1.0, 1.0, 1.0])
    world = np.array([[cos(yaw), -sin(yaw), 0.0], [sin(yaw), cos(yaw), 0.0], [0.0, 0.0, 1.0]]) @ mirror

    def own(phi: float) -> Array:
        ring = small * (cos(phi) * across + sin(phi) * side)
        height = np.sqrt(max(big**2 - ring[1] ** 2, 0.0))
        return np.asarray(ring + (height - ring[2]) / along[2] * along)

    def axis(phi: float) -> Array:
        brace, chord = cos(phi) * across + sin(phi) * side, own(phi) * [0.0, 1.0, 1.0] / big
        return np.asarray(-world @ (brace + chord))

    def speed(phi: float) -> float:
        # The tangent is normal to both surfaces' normals; it is scaled by its turn about the brace.
        brace, chord = cos(phi) * across + sin(phi) * side, own(phi) * [0.0, 1.0, 1.0] / big
        tangent = np.cross(brace, chord)
        about = tangent @ (-sin(phi) * across + cos(phi) * side)
        return float(small * np.linalg.norm(tangent) / abs(about))

    first, last = (radians(p) for p in case["phi"])
    return by_arc(lambda phi: world @ own(phi) + case["origin"], axis, speed, first, last)


def polyline(case: Case) -> Seam:
    """A file's points x, y, z and outward normals nx, ny, nz, joined by quintic splines over their chord lengths."""
    table = pd.read_csv(case["seam_file"])
    table.columns = [str(name).split("[")[0].strip() for name in table.columns]
    yaw = radians(case["yaw"])
    world = np.array([[cos(yaw), -sin(yaw), 0.0], [sin(yaw), cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    points = table[["x", "y", "z"]].to_numpy(float) @ world.T + case["origin"]
    normals = table[["nx", "ny", "nz"]].to_numpy(float) @ world.T
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    place = make_interp_spline(chord, points, k=5)
    axis = make_interp_spline(chord, -normals / np.linalg.norm(normals, axis=1)[:, None], k=5)
    slope = place.derivative()
    return by_arc(place, axis, lambda t: float(np.linalg.norm(slope(t))), 0.0, float(chord[-1]))
