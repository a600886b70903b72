"""Errors of the library: each says what was given, what is allowed, and what to do."""

from collections.abc import Iterable
from difflib import get_close_matches

LONGEST, MOST_NAMES = 80, 300  # of a value, and of a list of names, in a message [characters]: our choice


def quoted(value: object, most: int = LONGEST) -> str:
    """A value as a message quotes it, its middle left out where it is long."""
    return cut(repr(value), most)


def cut(text: str, most: int = LONGEST) -> str:
    """A text, its middle left out where it is long."""
    if len(text) <= most:
        return text
    half = most // 2
    return f"{text[:half]} .. {text[-half:]} ({len(text)} characters)"


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is most like a wrong one, as a message goes on to say; nothing where none is like it."""
    found = get_close_matches(name, known, 1)
    return f" (nearest is {found[0]!r})" if found else ""


class OcpTrajError(Exception):
    """Base of every error this package raises on purpose."""


class InputError(OcpTrajError, ValueError):
    """An argument, option or file of the user's is at fault."""


class UnknownName(InputError):
    """A problem, objective, limit, field or method that does not exist was asked for."""


class ProblemDefinitionError(InputError):
    """A problem, limit, objective or NLP does not hang together."""


class RobotDefinitionError(InputError):
    """A robot, its limits or its description file does not hang together."""


class UnsupportedJoint(InputError):
    """The model has a joint the symbolic dynamics do not cover."""


class UnsupportedOperation(InputError):
    """A tape holds an operation the evaluator does not know."""


class KinkedExpression(InputError):
    """A limit is not smooth, so that a second-order proof of it would be unsound."""


class FileFormatError(InputError):
    """A file cannot be read, or is not what it should be."""


class NoSolutionFound(OcpTrajError):
    """A solver did not end with a feasible point; the message says which limits conflict."""
