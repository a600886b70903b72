"""Proof that a motion respects every limit at every instant."""
