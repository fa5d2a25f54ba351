"""Work on the newest of what is asked for, as a check while somebody types."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_QUIET = 0.25
"""Seconds for which nothing new must come before the work begins."""


class Newest(Generic[Item, Result]):
    """Works on the newest item, once it has been quiet; others are passed over.

    Parameters
    ----------
    work : callable
        Takes an item.
    done : callable
        Takes an item and what came of it, unless a newer one has come meanwhile.
    """

    def __init__(
        self, work: Callable[[Item], Result], done: Callable[[Item, Result], object]
    ) -> None:
        self._work, self._done, self._asked = work, done, 0
        self._busy = threading.Lock()

    def ask(self, item: Item) -> None:
        """Ask for an item; what was asked before and not begun is dropped."""
        self._asked += 1
        timer = threading.Timer(_QUIET, self._run, (item, self._asked))
        timer.daemon = True
        timer.start()

    def close(self) -> None:
        """Begin nothing more."""
        self._asked += 1

    def _run(self, item: Item, number: int) -> None:
        with self._busy:
            if number == self._asked:
                result = self._work(item)
                if number == self._asked:
                    self._done(item, result)
