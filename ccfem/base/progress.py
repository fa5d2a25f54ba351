"""How long tasks report their progress."""

import logging
import re
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, float], None]
"""Called with the name of the current step and the share of all work, in [0, 1], that is done."""

_LEAST = 0.05
"""Share of the work from which on the time that is left is worth a word."""


def silent(what: str, share: float) -> None:
    """Report nothing."""


def time_left(spent: float, share: float) -> str:
    """Say how long work will still take, by the time that its share took so far.

    Parameters
    ----------
    spent : float, s
    share : float in [0, 1]
        Of the work that is done.

    Returns
    -------
    str
        Empty where too little is done to tell.

    Examples
    --------
    >>> time_left(30.0, 0.25)
    'about 90 s left'
    >>> time_left(300.0, 0.25)
    'about 15 min left'
    """
    return _in_words(_seconds_left(spent, share))


def _seconds_left(spent: float, share: float) -> float | None:
    """Return seconds that work will still take; None where too little is done to tell."""
    return spent * (1.0 - share) / share if _LEAST <= share < 1.0 else None


def _in_words(left: float | None) -> str:
    return "" if left is None or left < 0.0 else f"{about(left)} left"


def about(seconds: float) -> str:
    """Say a time in words, as "about 90 s" and "about 15 min"."""
    return f"about {seconds:.0f} s" if seconds < 120.0 else f"about {seconds / 60.0:.0f} min"


@contextmanager
def progress_bar(lines: bool = False) -> Iterator[Progress]:
    """Progress bar on the terminal's stderr or in a notebook.

    Every step is also logged (`logging`, "ccfem", level INFO).

    Parameters
    ----------
    lines : bool, default False
        Where there is neither a terminal nor a notebook, write a line for each step to stderr;
        else nothing.

    Examples
    --------
    >>> with progress_bar() as progress:
    ...     progress("half of it", 0.5)
    """
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        Task,
        TextColumn,
        TimeElapsedColumn as Elapsed,
    )
    from rich.text import Text

    console, start = Console(stderr=True), time.perf_counter()
    if not (console.is_terminal or console.is_jupyter):
        yield _log_steps(_line if lines else None)
        return

    class Left(ProgressColumn):
        """Time that is left: what was told, less what has passed since."""

        def render(self, task: Task) -> Text:
            ends = task.fields["ends"]
            return Text(_in_words(None if ends is None else ends - time.perf_counter()))

    columns = (BarColumn(), Elapsed(), TextColumn("{task.description}"), Left())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0, ends=None)
        log = _log_steps(None)

        def tell(what: str, share: float) -> None:
            log(what, share)
            now = time.perf_counter()
            left = _seconds_left(now - start, share)
            ends = None if left is None else now + left
            bar.update(task, description=escape(what), completed=share, ends=ends)

        yield tell


_LINE = re.compile(r"ccfem: \d+ s, (\d+) %(?:, (about [^:]* left))?: (.*)")


def step_of(line: str) -> tuple[float, str] | None:
    """Share of the work and step that a line of `progress_bar` says; None of another line."""
    match = _LINE.fullmatch(line.strip())
    if match is None:
        return None
    return int(match[1]) / 100.0, f"{match[3]} ({match[2]})" if match[2] else match[3]


def _line(text: str) -> None:
    print(f"ccfem: {text}", file=sys.stderr, flush=True)


def _log_steps(write: Callable[[str], None] | None) -> Progress:
    """Progress that logs the name of each step once, and writes it."""
    start, last = time.perf_counter(), ""
    logger = logging.getLogger("ccfem")

    def tell(what: str, share: float) -> None:
        nonlocal last
        if what == last:
            return
        last = what
        spent = time.perf_counter() - start
        left = time_left(spent, share)
        logger.info("%.1f s, %.0f %%: %s", spent, 100.0 * share, what)
        if write is not None:
            write(f"{spent:.0f} s, {100.0 * share:.0f} %{', ' + left if left else ''}: {what}")

    return tell
