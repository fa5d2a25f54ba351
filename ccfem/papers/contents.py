"""What of a paper can be made again: its study, tables, figures, and claims beside ours."""

import json
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ccfem.base.progress import Progress, silent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

K = TypeVar("K")
V = TypeVar("V")


class WhenAsked(Mapping[K, V]):
    """Pieces of a study, each computed when it is first asked for: a figure needs few of them.

    Parameters
    ----------
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


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown table."""
    lines = [f"| {' | '.join(cells)} |" for cells in (head, *rows)]
    lines.insert(1, "|---" * len(head) + "|")
    return "\n".join(lines) + "\n"


def drawn_of(
    figures: Mapping[str, "Callable[[], Figure | None]"], number: int | None
) -> dict[str, "Figure"]:
    """Draw the figures of a number, or all; those that give None are left out."""
    wanted = "figure_" if number is None else f"figure_{number:02}"
    made = {name: draw() for name, draw in figures.items() if name.startswith(wanted)}
    return {name: figure for name, figure in made.items() if figure is not None}


def write_figures(made: Mapping[str, "Figure"], folder: Path) -> list[str]:
    """Write figures as PNG into a folder; the names of the files."""
    from ccfem.comparison.plot.canvas import save

    for name, figure in made.items():
        save(figure, folder / f"{name}.png")
    return [f"{name}.png" for name in made]


def write_report(
    folder: Path, introduction: str, sections: Mapping[str, str], drawn: Sequence[str]
) -> None:
    """Write ``report.md``: an introduction, sections by heading, and the figures of some files."""
    parts = [introduction, *(f"## {heading}\n\n{text}" for heading, text in sections.items())]
    parts += ["## Figures\n", *(f"![{name}]({name})\n" for name in drawn)]
    (folder / "report.md").write_text("\n".join(parts), encoding="utf-8")


def write_claims(folder: Path, quantities: Mapping[str, float], expected: Path) -> str:
    """Write the quantities of a run, and the claims judged by them; the table of claims."""
    text = json.dumps(quantities, indent=1)
    (folder / "quantities.json").write_text(text, encoding="utf-8")
    claims = claim_table(judged(quantities, expected))
    (folder / "claims.md").write_text(claims, encoding="utf-8")
    return claims


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
    shown : str, default ""
        File of the folder whose text the command prints.
    """

    title: str
    seconds: float
    whole: Callable[[Path, Progress], None]
    run: Callable[[Progress], Any] = lambda progress: None
    tables: Mapping[str, Callable[[Callable[[], Any]], str]] = field(default_factory=dict)
    figures: Callable[[Any, int], Mapping[str, "Figure"]] = lambda study, number: {}
    numbers: tuple[int, ...] = ()
    needs: str = ""
    shown: str = ""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the tables and figures."""
        return (*self.tables, *(f"figure{number}" for number in self.numbers))


@dataclass(frozen=True)
class Check:
    """One number of one claim; `verdict` is "reproduced", "differs", "undecided" or "not tried".

    `low` to `high` counts as reproduced: what the paper says, widened by `tolerance`. Nearer to
    either than the resolution of what measured it, a number is undecided.
    """

    claim: str
    text: str
    source: str
    quantity: str
    paper: str
    low: float
    high: float
    tolerance: str
    ours: float
    verdict: str
    why: str


def judged(quantities: Mapping[str, float], path: Path) -> list[Check]:
    """Judge every check of a file of claims by the quantities of a run.

    A claim's `resolution` is that of its numbers, 0 where none stands there.
    """
    checks = []
    for claim in tomllib.loads(path.read_text(encoding="utf-8"))["claim"]:
        for check in claim["checks"]:
            ours = quantities.get(check["quantity"], np.nan)
            low, high = check["low"], check["high"]
            if np.isnan(ours):
                verdict = "not tried"
            else:
                inside = low - 1e-9 <= ours <= high + 1e-9
                near = min(abs(ours - low), abs(ours - high)) < claim.get("resolution", 0.0)
                verdict = "undecided" if near else "reproduced" if inside else "differs"
            about = (claim["id"], claim["text"], claim["source"])
            why = claim["why"] if verdict != "reproduced" else ""
            stated = (check["quantity"], check["paper"], low, high, claim["tolerance"])
            checks.append(Check(*about, *stated, ours, verdict, why))
    return checks


def claim_table(checks: list[Check]) -> str:
    """Markdown table claim / paper / ours / verdict; tolerances and reasons below it."""
    head = ("claim", "source", "quantity", "paper", "counts as reproduced", "ours", "verdict")
    rows = []
    for k, c in enumerate(checks):
        new = k == 0 or checks[k - 1].claim != c.claim
        about = (f"{c.claim} {c.text}", c.source) if new else ("", "")
        ours = "–" if np.isnan(c.ours) else f"{c.ours:.4g}"
        rows.append((*about, c.quantity, c.paper, _range(c), ours, c.verdict))
    lines = [table(head, rows), "Tolerance of each claim:", ""]
    lines += [
        f"- {k}: {text}" for k, text in {c.claim: c.tolerance for c in checks}.items() if text
    ]
    lines += ["", "Where ours differs, is undecided or was not tried:", ""]
    lines += [f"- {k}: {text}" for k, text in {c.claim: c.why for c in checks if c.why}.items()]
    return "\n".join(lines) + "\n"


def _range(check: Check) -> str:
    """Write what counts as reproduced; a million stands for no limit."""
    if check.low == check.high:
        return f"{check.low:g}"
    return f"from {check.low:g}" if check.high >= 1e6 else f"{check.low:g} to {check.high:g}"
