"""Numbers of a few digits that stay on one side of a value: a printed or stored bound is still a bound."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context


def rounded_down(value: float, digits: int) -> float:
    """The largest number of so many significant digits that is not above a value."""
    return _rounded(value, digits, ROUND_FLOOR)


def rounded_up(value: float, digits: int) -> float:
    """The smallest number of so many significant digits that is not below a value."""
    return _rounded(value, digits, ROUND_CEILING)


def _rounded(value: float, digits: int, direction: str) -> float:
    return float(Context(prec=digits, rounding=direction).create_decimal_from_float(value))
