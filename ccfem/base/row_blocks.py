"""Rows of large arrays, kept block by block: blocks that are equal are in memory once.

Layers of a print that repeat others differ by their height alone. So that this shows, a block keeps
each component of its rows by itself: lengths in thousandths by their steps from the last one, where
these tell them to the last bit, and values that are few by their places in a table.
"""

import hashlib
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import DTypeLike, NDArray

SMALL = 16_000_000
"""Bytes up to which rows are one array as any other."""

_FINE = 1000.0
"""Steps to a millimetre of coordinates that are rounded."""
_FAR = 2**30
"""Steps that are not kept in four bytes."""
_TINY = 1024
"""Bytes of a component up to which it is kept as it is: blocks of single paths are not compared."""
_FEW = 0.25
"""Share of values up to which those that differ are a table. Our choice."""
_SPARSE = 8
"""Times as many rows from the first to the last as are taken, from which blocks are read alone."""


class _Component(NamedTuple):
    """One component of a block: values, steps of 1 / 1000 from `base`, or places in a table."""

    kept: NDArray[Any]
    base: float | None = None
    table: NDArray[Any] | None = None

    def values(self, some: slice = slice(None)) -> NDArray[Any]:
        """Values of some rows."""
        kept = self.kept[some]
        if self.table is not None:
            return np.asarray(self.table[kept])
        return kept if self.base is None else (kept + self.base) / _FINE

    def between(self, begin: int, end: int) -> "_Component":
        """Those of rows from one to another."""
        return self._replace(kept=self.kept[begin:end])


def _bits(values: NDArray[Any]) -> NDArray[Any]:
    """Values to the last bit, with the signs of zeros."""
    return np.ascontiguousarray(values).view(f"u{values.itemsize}")


def _steps(values: NDArray[Any]) -> _Component | None:
    """Take steps of 1 / 1000 between values; None where they do not tell them to the last bit."""
    if values.dtype != np.float64 or not np.abs(values).max() * _FINE < _FAR:
        return None
    steps = np.rint(_FINE * values)
    found = _Component((steps - steps[-1]).astype(np.int32), float(steps[-1]))
    return found if np.array_equal(_bits(found.values()), _bits(values)) else None


def _places(values: NDArray[Any]) -> _Component | None:
    """Take places in a table of the values; None where these are many or small."""
    if values.itemsize < 4:
        return None
    table, places = np.unique(_bits(values), return_inverse=True)
    if len(table) > min(_FEW * len(values), 2**16):
        return None
    return _Component(places.astype(np.uint16), None, table.view(values.dtype))


class RowBlocks(NDArrayOperatorsMixin):
    """Rows of an array in blocks. It is read as the array that it stands for.

    A slice, and rows by their numbers, cost what lies between the first and the last of them; all
    else makes the whole array for the time being.
    """

    def __init__(self, dtype: DTypeLike, *shape: int) -> None:
        self.dtype, self._row = np.dtype(dtype), shape
        self._ends = [0]
        self._blocks: list[tuple[_Component, ...]] = []
        self._known: dict[bytes, NDArray[Any]] = {}

    def append(self, rows: NDArray[Any]) -> None:
        """Add rows at the end, as a block, or as the blocks that they are in."""
        if isinstance(rows, RowBlocks):
            self._blocks += rows._blocks
            self._ends += [self._ends[-1] + end for end in rows._ends[1:]]
        elif len(rows):
            columns = np.asarray(rows, self.dtype).reshape(len(rows), -1).T
            self._blocks.append(tuple(map(self._once, columns)))
            self._ends.append(self._ends[-1] + len(rows))

    def _once(self, values: NDArray[Any]) -> _Component:
        """Component of a block, which refers to an equal one that is known."""
        bits = _bits(values)
        if (bits == bits[0]).all():
            return _Component(np.broadcast_to(values[:1].copy(), values.shape))
        if values.nbytes <= _TINY:
            return _Component(np.array(values))
        found = _steps(values) or _places(values) or _Component(values)
        kept = np.ascontiguousarray(found.kept)
        digest = hashlib.sha256(kept.tobytes()).digest() + kept.dtype.char.encode()
        kept = self._known.setdefault(digest, np.array(kept) if kept.base is not None else kept)
        kept.flags.writeable = False
        return found._replace(kept=kept)

    def insert(self, places: Sequence[int], rows: NDArray[Any]) -> None:
        """Insert rows before those at some places, which do not fall."""
        cuts = sorted(set(places))
        old, self._blocks, ends = self._blocks, [], self._ends
        self._ends, given, at = [0], iter(rows), list(places)
        for block, (begin, end) in zip(old, pairwise(ends), strict=True):
            edges = [begin, *(cut for cut in cuts if begin < cut < end), end]
            for first, last in pairwise(edges):
                while at and at[0] <= first:
                    self.append(next(given)[None])
                    at.pop(0)
                self._blocks.append(tuple(c.between(first - begin, last - begin) for c in block))
                self._ends.append(self._ends[-1] + last - first)
        for row in given:
            self.append(row[None])

    def rows(self) -> NDArray[Any]:
        """All rows, read-only: an array if it is small or all are one row, else these blocks."""
        self._known = {}
        one = self._one_row()
        if one is not None:
            return np.broadcast_to(one, self.shape)
        if self.nbytes > SMALL:
            return cast("NDArray[Any]", self)
        whole = self._between(0, len(self))
        whole.flags.writeable = False
        return whole

    def _one_row(self) -> NDArray[Any] | None:
        """Row that all rows are in memory; None where they are not one."""
        kept = (component.kept for block in self._blocks for component in block)
        if len(self) < 2 or any(len(values) > 1 and values.strides[0] for values in kept):
            return None
        first = slice(0, 1)
        rows = np.array([[c.values(first)[0] for c in block] for block in self._blocks], self.dtype)
        same = (_bits(rows) == _bits(rows[:1])).all()
        return rows[0].reshape(self._row) if same else None

    def _between(self, begin: int, end: int) -> NDArray[Any]:
        """Rows from one to another."""
        rows = np.empty((max(end - begin, 0), *self._row), self.dtype)
        if end <= begin:
            return rows
        columns = rows.reshape(len(rows), -1).T
        number = max(int(np.searchsorted(self._ends, begin, side="right")) - 1, 0)
        while number < len(self._blocks) and self._ends[number] < end:
            first, last = self._ends[number : number + 2]
            some = slice(max(begin, first) - first, min(end, last) - first)
            here = slice(max(begin, first) - begin, min(end, last) - begin)
            for column, component in zip(columns, self._blocks[number], strict=True):
                column[here] = component.values(some)
            number += 1
        return rows

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the array that it stands for."""
        return (len(self), *self._row)

    @property
    def ndim(self) -> int:
        """Number of its axes."""
        return 1 + len(self._row)

    @property
    def nbytes(self) -> int:
        """Bytes that the array would take."""
        return self.dtype.itemsize * math.prod(self.shape)

    def __len__(self) -> int:
        return self._ends[-1]

    def __iter__(self) -> Iterator[Any]:
        return iter(self._between(0, len(self)))

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, tuple):
            of_rows = isinstance(key[0], int | np.integer | slice | np.ndarray)
            if not of_rows or not all(isinstance(k, int | np.integer | slice) for k in key[1:]):
                return np.asarray(self)[key]
            rows, inner = self[key[0]], key[1:]
            return rows[inner if isinstance(key[0], int | np.integer) else (slice(None), *inner)]
        if isinstance(key, slice):
            begin, end, step = key.indices(len(self))
            return self._between(begin, end) if step == 1 else np.asarray(self)[key]
        if isinstance(key, int | np.integer):
            at = range(len(self))[int(key)]
            return self._between(at, at + 1)[0]
        if isinstance(key, np.ndarray) and key.dtype == bool and key.shape == (len(self),):
            return self._masked(key)
        numbers = key
        if not isinstance(numbers, np.ndarray) or numbers.dtype.kind not in "iu":
            return np.asarray(self)[key]
        if not numbers.size:
            return np.empty((*numbers.shape, *self._row), self.dtype)
        if numbers.min() < 0 or numbers.max() >= len(self):
            return np.asarray(self)[numbers]
        first, last = int(numbers.min()), int(numbers.max())
        if numbers.ndim == 1 and last - first > _SPARSE * len(numbers):
            return self._scattered(numbers)
        return self._between(first, last + 1)[numbers - first]

    def _masked(self, mask: NDArray[np.bool_]) -> NDArray[Any]:
        """Rows where a mask is set, without all of them."""
        rows, count = np.empty((int(np.count_nonzero(mask)), *self._row), self.dtype), 0
        for begin, end in pairwise(self._ends):
            taken = mask[begin:end]
            more = count + int(np.count_nonzero(taken))
            if more > count:
                rows[count:more] = self._between(begin, end)[taken]
            count = more
        return rows

    def _scattered(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """Rows by numbers that are far apart."""
        rows = np.empty((len(numbers), *self._row), self.dtype)
        block = np.searchsorted(self._ends, numbers, side="right") - 1
        order = np.argsort(block, kind="stable")
        for some in np.split(order, np.flatnonzero(np.diff(block[order])) + 1):
            begin, end = self._ends[block[some[0]] : block[some[0]] + 2]
            rows[some] = self._between(begin, end)[numbers[some] - begin]
        return rows

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        whole = self._between(0, len(self))
        return whole if dtype is None else whole.astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *given: Any, **options: Any) -> Any:
        if any(isinstance(one, RowBlocks) for one in options.get("out", ())):
            raise ValueError("output array is read-only")
        plain = (np.asarray(one) if isinstance(one, RowBlocks) else one for one in given)
        return getattr(ufunc, method)(*plain, **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(np.asarray(self), name)
