"""What of a paper can be made again: its study, tables and figures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Contents"]


@dataclass(frozen=True)
class Contents:
    """A paper's study, and what is made of it.

    Attributes
    ----------
    title : str
        Authors, year and subject.
    seconds : float
        About how long the study takes on two cores.
    run : callable
        The study.
    whole : callable of Path
        Runs the study and writes figures, tables and claims into a folder.
    tables : mapping of name to callable
        Each is called with a function that gives the study, which is run when first asked for:
        some tables need none. Returns Markdown.
    figures : callable
        Called with the study; figures by name, as ``figure_08_bridge_curvature``.
    numbers : tuple of int
        Numbers of the figures.
    needs : str, default ""
        Environment variable that must name the authors' data.
    """

    title: str
    seconds: float
    run: Callable[[], Any]
    whole: Callable[[Path], None]
    tables: Mapping[str, Callable[[Callable[[], Any]], str]]
    figures: Callable[[Any], Mapping[str, "Figure"]]
    numbers: tuple[int, ...]
    needs: str = ""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the tables and figures."""
        return (*self.tables, *(f"figure{number}" for number in self.numbers))
