"""What the tabs of the page share: what they ask of it, and how they show a table."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

from ccfem.workbench.bench import Bench
from ccfem.workbench.guard import escaped
from ccfem.workbench.part_edits import Change

PART, STRESS, MOVED, FIBRE = VIEWS = ("Part", "Stress", "Deformed", "Fibre")
"""What the page shows in space: the part to be set up, or what the last run says of it."""


class Tabbed(Protocol):
    """The page, as its tabs see it."""

    bench: Bench
    server: Any
    view: Any
    chosen: list[int]

    def act(self, what: Callable[..., None], *arguments: Any) -> Any:
        """Do something when all before it is done."""

    def on(self, what: Callable[..., None], *arguments: Any) -> Callable[[Any], Any]:
        """Return a callback of viser that does something."""

    def on_value(self, what: Callable[..., None], *arguments: Any) -> Callable[[Any], Any]:
        """Return a callback of viser that does something with the value of its field."""

    def say(self, text: str) -> None:
        """Show a line at the top."""

    def edit(self, change: Change | str, field: str = "") -> None:
        """Change the part file, and show it."""

    def open(self, what: str) -> None:
        """Open a part."""

    def choose(self, number: int, more: bool) -> None:
        """Choose a face."""

    def choose_all(self, numbers: Sequence[int]) -> None:
        """Choose these faces."""

    def show_view(self, view: str) -> None:
        """Show one of `VIEWS`."""


def table_html(heads: Sequence[str], rows: Sequence[Sequence[str]], marked: str = "") -> str:
    """HTML of a table whose first column names the rows; all texts are escaped.

    Parameters
    ----------
    marked : str
        Name of the row that is marked.
    """
    head = "".join(f'<th scope="col">{escaped(title)}</th>' for title in heads)
    body = ""
    for name, *cells in rows:
        row = "".join(f"<td>{escaped(cell)}</td>" for cell in cells)
        kind = ' class="best"' if name == marked else ""
        body += f'<tr{kind}><th scope="row">{escaped(name)}</th>{row}</tr>'
    return f'<div class="ccfem wide" tabindex="0"><table><tr>{head}</tr>{body}</table></div>'
