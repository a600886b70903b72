"""Paths of a tool: seams, the polynomials that stand for them, arms that follow them."""
