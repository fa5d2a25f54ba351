"""Work on the newest of what is asked for, as a check while somebody types."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

_QUIET = 0.25
"""Seconds for which nothing new must come before the work begins."""


class Newest(Generic[Item, Result]):
    """A thread that works on the newest item, once it has been quiet; others are passed over.

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
        self._work, self._done = work, done
        self._asked: list[Item] = []
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="newest", daemon=True)
        self._thread.start()

    def ask(self, item: Item) -> None:
        """Ask for an item; what was asked before and not begun is dropped."""
        with self._changed:
            self._asked = [item]
            self._changed.notify_all()

    def close(self) -> None:
        """Begin nothing more."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _news(self) -> bool:
        return bool(self._asked) or self._closed

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(self._news)
                item = self._asked.pop() if not self._closed else None
                while not self._closed and self._changed.wait_for(self._news, _QUIET):
                    item = self._asked.pop() if self._asked else item
                if self._closed or item is None:
                    return
            result = self._work(item)
            with self._changed:
                newest = not self._news()
            if newest:
                self._done(item, result)
