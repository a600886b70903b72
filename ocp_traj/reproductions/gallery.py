"""The figures of a paper: each drawn with ours beside the paper's points, or named with the reason why not."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # slow to import, and drawn with only where pictures are asked for

    Draw = Callable[[], Figure]

NO_POPULATION = "no population was run: seeds is 0"


@dataclass(frozen=True)
class Listed:
    """A figure as the list of a paper's figures has it.

    Attributes:
        number: as the paper has it, such as ``Figure 9``; a figure of ours has a name.
        shows: what it shows.
        made_of: what ours is drawn from; empty where none can be made.
        why_not: why none can be made; empty where one is.
    """

    number: str
    shows: str
    made_of: str = ""
    why_not: str = ""

    def __post_init__(self) -> None:
        """Checks that it is either made or not."""
        assert bool(self.made_of) != bool(self.why_not), self.number

    @property
    def stem(self) -> str:
        """Of its file's name: numbers with two digits, so that files lie in order."""
        padded = re.sub(r"\d+", lambda found: found[0].zfill(2), self.number)
        return re.sub(r"[^a-z0-9]+", "-", padded.lower()).strip("-")


@dataclass(frozen=True, eq=False)
class PaperFigure:
    """A figure of a reproduction.

    Attributes:
        listed: what it is.
        draw: makes it; None where it is not made.
        words: what ours is drawn from, or why it is not made.
    """

    listed: Listed
    draw: Draw | None
    words: str

    @property
    def made(self) -> bool:
        """Whether it can be drawn."""
        return self.draw is not None

    def to_dict(self) -> dict[str, object]:
        """As plain JSON values."""
        return {"figure": self.listed.number, "shows": self.listed.shows, "made": self.made, "words": self.words}


def gallery(
    listed: Sequence[Listed], drawn: Mapping[str, tuple[Draw, str]], missing: Mapping[str, str]
) -> tuple[PaperFigure, ...]:
    """All figures of a list, in its order.

    Args:
        listed: figures of the paper, and of ours.
        drawn: how to draw those that can be, and what they are made of where the list does not say, by number.
        missing: why others are not made, by number.
    """
    known = {one.number for one in listed}
    assert known >= {*drawn, *missing}, (drawn, missing)
    found = []
    for one in listed:
        if one.number in drawn:
            draw, words = drawn[one.number]
            found.append(PaperFigure(one, draw, words or one.made_of))
        else:
            found.append(PaperFigure(one, None, missing.get(one.number) or one.why_not or NO_POPULATION))
    return tuple(found)


def listing(listed: Sequence[Listed]) -> str:
    """A list of figures as a Markdown table."""
    rows = [f"| {one.number} | {one.shows} | {one.made_of or f'not made: {one.why_not}'} |" for one in listed]
    return "\n".join(["| figure | shows | ours |", "|---|---|---|", *rows])
