"""Work on many things side by side, in threads; at most CCFEM_NUM_THREADS where that is set."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

_MOST = 4
"""Threads at a time; much of the work waits for the interpreter's lock."""

Result = TypeVar("Result")


def in_threads(
    work: Callable[..., Result], *items: Sequence[Any], most: int | None = _MOST
) -> list[Result]:
    """Results of a function for each of some items, in their order, several at a time.

    Parameters
    ----------
    work : callable
        Called from several threads at once, with one item of each sequence.
    *items : sequences of one length
    most : int, optional
        Threads at a time, default 4; None for as many as there are processors, where the work
        frees the interpreter.

    Raises
    ------
    Exception
        The first that `work` raises, in the order of the items.
    """
    processors = int(os.environ.get("CCFEM_NUM_THREADS", 0)) or os.cpu_count() or 1
    count = min(processors, processors if most is None else most, max(len(items[0]), 1))
    if count == 1:
        return [work(*arguments) for arguments in zip(*items, strict=True)]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, *items))
