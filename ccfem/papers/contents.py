"""What of a paper can be made again: its study, tables and figures."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
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
    whole : callable of Path
        Runs the study and writes figures, tables and claims into a folder.
    run : callable, optional
        The study alone, for its tables and figures one by one.
    tables : mapping of name to callable
        Each is called with a function that gives the study, which is run when first asked for:
        some tables need none. Returns Markdown.
    figures : callable
        Called with the study; figures by name, as ``figure_08_bridge_curvature``.
    numbers : tuple of int
        Numbers of the figures that can be drawn alone.
    needs : str, default ""
        Environment variable that must name the authors' data.
    """

    title: str
    seconds: float
    whole: Callable[[Path], None]
    run: Callable[[], Any] = lambda: None
    tables: Mapping[str, Callable[[Callable[[], Any]], str]] = field(default_factory=dict)
    figures: Callable[[Any], Mapping[str, "Figure"]] = lambda study: {}
    numbers: tuple[int, ...] = ()
    needs: str = ""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the tables and figures."""
        return (*self.tables, *(f"figure{number}" for number in self.numbers))
