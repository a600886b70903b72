"""Interval arithmetic that rounds outward, and SX functions evaluated in it."""
