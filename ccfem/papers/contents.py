"""What of a paper can be made again: its study, tables and figures."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ccfem.base.progress import Progress, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

K = TypeVar("K")
V = TypeVar("V")


class WhenAsked(Mapping[K, V]):
    """Pieces of a study, each computed when it is first asked for: a figure needs few of them.

    Parameters
    ----------
    keys : sequence
    compute : callable
        Makes the piece of a key.
    progress : callable, optional
        Told the name of each piece before it is computed, and the share of those that are done.
    what : str
        What is done to a piece, in front of its name.

    Examples
    --------
    >>> squares = WhenAsked((2, 3), lambda k: k * k)
    >>> 3 in squares, squares[3], squares.computed
    (True, 9, (3,))
    """

    def __init__(
        self,
        keys: Sequence[K],
        compute: Callable[[K], V],
        progress: Progress = silent,
        what: str = "computing",
    ) -> None:
        self._keys, self._compute = tuple(keys), compute
        self._progress, self._what = progress, what
        self._done: dict[K, V] = {}

    def __getitem__(self, key: K) -> V:
        if key not in self._done:
            if key not in self._keys:
                raise KeyError(key)
            self._progress(f"{self._what} {key}", len(self._done) / len(self._keys))
            self._done[key] = self._compute(key)
        return self._done[key]

    def __contains__(self, key: object) -> bool:
        return key in self._keys

    def __iter__(self) -> Iterator[K]:
        return iter(self._keys)

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def computed(self) -> tuple[K, ...]:
        """Keys of the pieces that have been computed."""
        return tuple(self._done)


def drawn_of(
    figures: Mapping[str, "Callable[[], Figure | None]"], number: int | None
) -> dict[str, "Figure"]:
    """Draw the figures of a number, or all; those that give None are left out."""
    wanted = "figure_" if number is None else f"figure_{number:02}"
    made = {name: draw() for name, draw in figures.items() if name.startswith(wanted)}
    return {name: figure for name, figure in made.items() if figure is not None}


@dataclass(frozen=True)
class Contents:
    """A paper's study, and what is made of it.

    Attributes
    ----------
    title : str
        Authors, year and subject.
    seconds : float
        About how long the study takes on two cores.
    whole : callable of Path and Progress
        Runs the study and writes figures, tables and claims into a folder.
    run : callable of Progress, optional
        The study alone, for its tables and figures one by one: its pieces are computed when they
        are asked for (`WhenAsked`).
    tables : mapping of name to callable
        Each is called with a function that gives the study, which is run when first asked for:
        some tables need none. Returns Markdown.
    figures : callable
        Called with the study and the number of a figure; figures of that number by name, as
        ``figure_08_bridge_curvature``.
    numbers : tuple of int
        Numbers of the figures that can be drawn alone.
    needs : str, default ""
        Environment variable that must name the authors' data.
    """

    title: str
    seconds: float
    whole: Callable[[Path, Progress], None]
    run: Callable[[Progress], Any] = lambda progress: None
    tables: Mapping[str, Callable[[Callable[[], Any]], str]] = field(default_factory=dict)
    figures: Callable[[Any, int], Mapping[str, "Figure"]] = lambda study, number: {}
    numbers: tuple[int, ...] = ()
    needs: str = ""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the tables and figures."""
        return (*self.tables, *(f"figure{number}" for number in self.numbers))
