"""The two errors that ccfem raises."""

import difflib
from collections.abc import Iterable

__all__ = ["InputError", "SolveError", "known_names"]


class InputError(ValueError):
    """Invalid input.

    The message is one line that says what was expected, what came and the cure; the command line
    prints it and exits with code 2.
    """


class SolveError(RuntimeError):
    """A solve that missed its tolerance; the message names the backend and the residual."""


def known_names(wanted: str, known: Iterable[str]) -> str:
    """List the known names for the message on an unknown one, and ask for the nearest.

    Examples
    --------
    >>> known_names("lop", ["bar", "loop"])
    "bar, loop: did you mean 'loop'?"
    >>> known_names("bridge", ["bar", "loop"])
    'bar, loop'
    """
    names = list(known)
    near = difflib.get_close_matches(wanted, names, n=1)
    return ", ".join(names) + (f": did you mean '{near[0]}'?" if near else "")
