"""The published problems, one file a paper, loaded by id: ``load("hybrid-spline", payload=8.0)``."""

from ocp_traj.formulation.registry import case_class, load, module, names, register, summary

__all__ = ["case_class", "load", "module", "names", "register", "summary"]
