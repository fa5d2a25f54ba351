"""The two errors that ccfem raises, how several mistakes become one, and what goes on without."""

import difflib
import reprlib
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Invalid input: whatever is outside what a function's parameters and files may be.

    The message is one line that says what was expected, what came and the cure; the command line
    prints it and exits with code 2.

    Attributes
    ----------
    mistakes : tuple of str
        All that was found, one line each, where several mistakes were; else the message.
    """

    def __init__(self, *lines: str) -> None:
        more = f" (and {len(lines) - 1} more: ccfem check names them all)" if lines[1:] else ""
        super().__init__("".join(lines[:1]) + more)
        self.mistakes = lines


class Mistakes:
    """Collects mistakes, so that all of them come at once.

    Examples
    --------
    >>> found = Mistakes()
    >>> with found.noted():
    ...     raise InputError("no foot")
    >>> with found.noted("body: "):
    ...     raise InputError("no head")
    >>> found.lines
    ['no foot', 'body: no head']
    """

    def __init__(self) -> None:
        self.lines: list[str] = []

    @contextmanager
    def noted(self, where: str = "") -> Iterator[None]:
        """Note what goes wrong in the block, and go on behind it."""
        try:
            yield
        except InputError as error:
            self.lines += [where + line for line in error.mistakes]

    def complain(self) -> None:
        """Raise where there were mistakes."""
        if self.lines:
            raise InputError(*dict.fromkeys(self.lines))


class SolveError(RuntimeError):
    """A solve that missed its tolerance; the message names the backend and the residual."""


@contextmanager
def spared(what: str, left_out: list[str]) -> Iterator[None]:
    """Go on without a picture or a view that fails in the block: the numbers behind it stand.

    What is left out, by what it draws, and why, is added to `left_out` as one line, and is a
    warning. A file that cannot be written is an error as elsewhere.
    """
    try:
        yield
    except OSError:
        raise
    except Exception as error:
        kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        left_out.append(f"{what} left out: {kind}{' '.join(str(error).split())}")
        warnings.warn(left_out[-1], UserWarning, stacklevel=3)


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


def shown(value: object) -> str:
    """Show what came, cut where it is long: an integer of 400 digits, a list of a thousand items.

    Examples
    --------
    >>> shown("abc")
    "'abc'"
    >>> len(shown(10**5000)) < 90, len(shown([[1.0] * 1000] * 1000)) < 300
    (True, True)
    """
    if isinstance(value, int) and abs(value) >= 10**40:
        return "a number of more than 40 digits"
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = 80
    return short.repr(value)
