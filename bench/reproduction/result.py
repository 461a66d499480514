"""What a reproduction gives: published numbers beside ours, and figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """One number of a paper and ours.

    Attributes
    ----------
    where : str
        Table, figure, equation or section of the paper.
    quantity : str
        What it is, in a few words.
    unit : str
    published : float
        The value as printed (or read off a figure: say so in `note`).
    ours : float
        The value measured on the virtual bench.
    tolerance : float
        Largest |ours - expected| that counts as the same; expected is `exact` where the paper
        is off, else `published`.
    reason : str
        Why this tolerance.
    exact : float or None
        What physics gives where the paper itself is off.
    note : str
        Anything that the reader must know.
    """

    where: str
    quantity: str
    unit: str
    published: float
    ours: float
    tolerance: float
    reason: str
    exact: float | None = None
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether ours is the expected value within the tolerance."""
        expected = self.published if self.exact is None else self.exact
        return math.isfinite(self.ours) and abs(self.ours - expected) <= self.tolerance

    def entry(self) -> dict[str, Any]:
        """Return the number's JSON object."""
        return {
            "where": self.where,
            "quantity": self.quantity,
            "unit": self.unit,
            "published": self.published,
            "ours": self.ours,
            "tolerance": self.tolerance,
            "reason": self.reason,
            "holds": self.holds,
            "exact": self.exact,
            "note": self.note,
        }


def claimed_zero(
    where: str,
    quantity: str,
    unit: str,
    ours: float,
    tolerance: tuple[float, str],
    *,
    exact: float | None = None,
    note: str = "",
) -> Published:
    """Return a number that the paper holds to be zero.

    Parameters
    ----------
    tolerance : (float, str)
        Tolerance and its reason.
    exact : float, optional
        What physics gives where it is not zero.
    """
    return Published(
        where=where,
        quantity=quantity,
        unit=unit,
        published=0.0,
        ours=ours,
        tolerance=tolerance[0],
        reason=tolerance[1],
        exact=exact,
        note=note,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperFigure:
    """One figure: drawn only when it is written, as matplotlib takes a while to import.

    Attributes
    ----------
    name : str
        File name without suffix, for instance ``cho-park-fig-7``.
    title : str
        What the paper calls it, for instance "Fig. 7: dip angle from the latitude".
    caption : str
        What is seen, what was set, and where it differs from the paper; plain sentences.
    draw : callable
        Returns the matplotlib figure.
    """

    name: str
    title: str
    caption: str
    draw: Callable[[], Figure]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """All of one paper.

    Attributes
    ----------
    paper : str
        Key on the command line: cho_park, skula, caruso, konvalin.
    title : str
        Authors, title, year.
    numbers : list of Published
    figures : list of PaperFigure
    remarks : list of str
        Sentences for the page: setup, noise, what was found.
    """

    paper: str
    title: str
    numbers: list[Published] = field(default_factory=list)
    figures: list[PaperFigure] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def holds(self) -> bool:
        """Whether every number holds."""
        return all(number.holds for number in self.numbers)

    def entry(self) -> dict[str, Any]:
        """Return the paper's JSON object."""
        return {
            "paper": self.paper,
            "title": self.title,
            "holds": self.holds,
            "numbers": [number.entry() for number in self.numbers],
            "figures": [figure.name for figure in self.figures],
            "remarks": list(self.remarks),
        }
