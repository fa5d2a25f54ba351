"""Frozen dataclasses of plain numbers and tuples, whatever numpy makes of what they are given."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar, dataclass_transform

import numpy as np

T = TypeVar("T")


def plain(value: Any) -> Any:
    """Turn arrays and lists into tuples, and numpy's numbers into Python's, inside tuples too."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple) and type(value) in (list, tuple):
        return tuple(map(plain, value))
    return value


@dataclass_transform(frozen_default=True)
def plain_dataclass(cls: type[T]) -> type[T]:
    """Frozen dataclass whose fields are made plain, so that it can be compared, hashed and written.

    Examples
    --------
    >>> @plain_dataclass
    ... class Corner:
    ...     place: tuple[float, float]
    >>> Corner(np.array([1.0, 2.0]))
    Corner(place=(1.0, 2.0))
    """
    made = dataclass(frozen=True)(cls)
    given: Callable[..., None] = made.__init__

    @wraps(given)
    def made_plain(self: T, *values: Any, **named: Any) -> None:
        given(self, *map(plain, values), **{name: plain(value) for name, value in named.items()})

    made.__init__ = made_plain  # type: ignore
    return made
