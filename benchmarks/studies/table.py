"""Tables that a study prints row by row, with pictures of its plans where they are asked for."""

from collections.abc import Callable, Iterable
from pathlib import Path

__all__ = ["print_table", "with_strategies"]


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


def with_strategies(
    arguments: list[str],
    heads: str,
    names: Iterable[str],
    rows: Callable[[str, Path | None, list[str]], list[str]],
) -> None:
    """Print a table of some parts and, with ``--strategies A,B``, of some strategies alone.

    Parameters
    ----------
    arguments, heads, names
        As of `print_table`.
    rows : callable
        Called with the names of strategies, too; with none for all.
    """
    strategies: list[str] = []
    if "--strategies" in arguments:
        at = arguments.index("--strategies")
        strategies = arguments[at + 1].split(",")
        arguments = arguments[:at] + arguments[at + 2 :]
    print_table(arguments, heads, names, lambda part, folder: rows(part, folder, strategies))
