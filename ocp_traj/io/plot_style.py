"""The look of every picture: one style, colours that colour-blind readers tell apart, files with the same bytes."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from cycler import cycler
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ocp_traj.errors import InputError, quoted
from ocp_traj.files import write_with

SUFFIXES = (".png", ".pdf", ".svg")
# Okabe and Ito (2008), https://jfly.uni-koeln.de/color/: told apart by all readers. Yellow is too pale for a line.
BLUE, VERMILLION, GREEN, PURPLE = "#0072B2", "#D55E00", "#009E73", "#CC79A7"
ORANGE, SKY, BLACK = "#E69F00", "#56B4E9", "#000000"
COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)
MARKERS = "osD^vPX<>*"
DASHES: tuple[Any, ...] = ("-", (0, (4.0, 1.6)), (0, (1.2, 1.4)), (0, (5.0, 1.5, 1.2, 1.5)))  # of motions, in order
LINE, LIMIT, KNOT, PAPER = BLUE, VERMILLION, "0.85", BLACK
STYLE: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],  # comes with Matplotlib: the same letters on every machine
    "font.size": 8.5,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.prop_cycle": cycler(color=list(COLOURS)),
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.use_mathtext": True,
    "grid.color": "0.92",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "legend.fontsize": 7.5,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.edgecolor": "none",
    "figure.titlesize": 10.0,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 180.0,
    "pdf.fonttype": 42,  # TrueType, which journals ask for
    "svg.fonttype": "path",
    "svg.hashsalt": "ocp-traj",  # else each file has names of its own
}
UNDATED = {"png": {"Software": None}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}
_EXPONENTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")

P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Runs a function that draws in the one style, whatever the user's own."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> R:
        with style.context(STYLE, after_reset=True):
            return draw(*args, **kwargs)

    return drawn


def pretty(unit: str) -> str:
    """A unit with its exponents raised: ``m/s2`` as ``m/s²``."""
    return unit.translate(_EXPONENTS)


def labelled(name: str, unit: str) -> str:
    """A quantity with its unit, for an axis; one without a unit by its name alone."""
    return f"{name} [{pretty(unit)}]" if unit else name


def number(value: float, digits: int = 4) -> str:
    """A number as a picture shows it, with a true minus sign."""
    whole = abs(value) < 1e6 and float(value).is_integer()
    return (f"{value:.0f}" if whole else f"{value:.{digits}g}").replace("-", "\N{MINUS SIGN}")


def far_bounds(axes: Axes, words: str) -> None:
    """Writes above the axes which bounds lie far from what they show."""
    axes.set_title(words, loc="right", fontsize=7.0, color=LIMIT, pad=3)


def check_picture(path: str | Path) -> str:
    """The picture format a file name asks for; ``InputError`` if there is none such. To be called before long work."""
    kind = Path(path).suffix.lower()
    if kind not in SUFFIXES:
        raise InputError(
            f"a picture is written as {', '.join(SUFFIXES)}; {quoted(Path(path).name)} ends otherwise: change its "
            "suffix"
        )
    return kind


@styled
def save_figure(figure: Figure, path: str | Path) -> Path:
    """Writes a figure in the format its file name asks for, whole or not at all."""
    target, kind = Path(path), check_picture(path)[1:]
    return write_with(target, lambda temporary: figure.savefig(temporary, format=kind, metadata=UNDATED[kind]))
