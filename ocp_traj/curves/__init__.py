"""Curves: piecewise Bezier, the families built on it, and motions along them."""

from ocp_traj.curves.bernstein import PiecewiseBezier
from ocp_traj.curves.families import cubic_spline_free_ends, nonic, polynomial_353, quartic_quintic

__all__ = ["PiecewiseBezier", "cubic_spline_free_ends", "nonic", "polynomial_353", "quartic_quintic"]
