"""Tables that a study prints row by row, with pictures of its plans where they are asked for."""

from collections.abc import Callable, Iterable
from pathlib import Path

__all__ = ["print_table"]


def print_table(
    arguments: list[str],
    heads: str,
    names: Iterable[str],
    rows: Callable[[str, Path | None], list[str]],
) -> None:
    """Print a table of some parts.

    Parameters
    ----------
    arguments : list of str
        Parts, by default all; ``--pictures FOLDER`` for the pictures.
    heads : str
        Heads of the columns, parted by bars.
    names : iterable of str
        All parts.
    rows : callable
        Rows of one part; called with its name, and the folder for pictures or None.
    """
    pictures = None
    if "--pictures" in arguments:
        at = arguments.index("--pictures")
        pictures = Path(arguments[at + 1])
        pictures.mkdir(parents=True, exist_ok=True)
        arguments = arguments[:at] + arguments[at + 2 :]
    print(f"| {heads} |")
    print("|" + (heads.count("|") + 1) * "---|")
    for name in arguments or names:
        print("\n".join(rows(name, pictures)), flush=True)
