"""Errors of the library: each says what was given, what is allowed, and what to do."""


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
