"""Array types, and read-only arrays and mappings for frozen dataclasses."""

import dataclasses
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from ccfem.base.row_blocks import RowBlocks

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]


def read_only(values: ArrayLike, dtype: DTypeLike = float) -> NDArray[Any]:
    """Return `values` as a C-contiguous array that nobody can write to.

    They are copied unless they are such an array of the right type already.
    """
    if isinstance(values, RowBlocks):
        return cast("NDArray[Any]", values)
    array = np.asarray(values)
    if array.dtype == dtype and array.flags.c_contiguous and not array.flags.writeable:
        return array
    array = np.array(array, dtype=dtype, order="C")
    array.flags.writeable = False
    return array


def seen_only(values: NDArray[Any]) -> NDArray[Any]:
    """Return the same values as a C-contiguous array that cannot be written to, without a copy.

    Numba compiles a function once for arrays that can be written to and once for others: arguments
    that come as either go through this.
    """
    view = np.ascontiguousarray(values).view()
    view.flags.writeable = False
    return view


def sealed(values: NDArray[Any]) -> NDArray[Any]:
    """Make an array that nobody else holds read-only in place, so that `read_only` keeps it."""
    values.flags.writeable = False
    return values


def is_shared(rows: NDArray[Any]) -> bool:
    """Whether all rows of an array are one row in memory."""
    return rows.ndim > 0 and len(rows) > 1 and rows.strides[0] == 0


def shared_rows(values: ArrayLike, dtype: DTypeLike = float) -> NDArray[Any]:
    """Return `values` as a read-only array whose rows are one row in memory where all are equal."""
    if isinstance(values, RowBlocks):
        return cast("NDArray[Any]", values)
    array = np.asarray(values)
    if len(array) < 2 or array.dtype != dtype:
        array = read_only(array, dtype)
    if len(array) < 2:
        return array
    if is_shared(array) or _alike(array):
        return np.broadcast_to(array[0].copy(), array.shape)
    return read_only(array, dtype)


def _alike(rows: NDArray[Any]) -> bool:
    """Whether all rows are equal to the last bit, with the signs of zeros."""
    same = bool((rows[-1] == rows[0]).all() and (rows == rows[0]).all())
    signs = rows.dtype.kind == "f" and not rows[0].all()
    return same and not (signs and (np.signbit(rows) != np.signbit(rows[0])).any())


_SMALL, _ALONE = 1_000_000, 2**25 + 4096
"""Bytes from which a buffer gets so many, of which it uses what it needs: pages of its own, which
grow where they are and leave no holes."""


class RowBuffer:
    """Rows that come block by block, in one array that grows where it is.

    Blocks that are joined at the end are there twice. Rows that are all equal share one in memory,
    if that is wanted.
    """

    def __init__(self, dtype: DTypeLike, *shape: int, share: bool = True) -> None:
        self._rows, self._share = np.empty((0, *shape), dtype), share
        self._one: NDArray[Any] | None = None
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, block: NDArray[Any]) -> None:
        """Add rows at the end."""
        block = np.asarray(block)
        if not len(block):
            return
        begin, self._count = self._count, self._count + len(block)
        if not begin and self._share:
            self._one = np.array(block[0], dtype=self._rows.dtype)
        if self._one is not None:
            ends = np.stack([self._one, block[0].astype(self._one.dtype)])
            if _alike(ends) and (is_shared(block) or _alike(block)):
                return
            first, self._one = self._one, None
            self._reserve(self._count)
            self._rows[:begin] = first
        self._reserve(self._count)
        self._rows[begin : self._count] = block

    def _reserve(self, count: int) -> None:
        if count <= len(self._rows):
            return
        shape = self._rows.shape[1:]
        size = self._rows.itemsize * max(math.prod(shape), 1)
        more = count + count // 16
        if count * size > _SMALL and self._rows.nbytes < _ALONE:
            rows = np.empty((max(more, _ALONE // size + 1), *shape), self._rows.dtype)
            rows[: len(self._rows)] = self._rows
            self._rows = rows
        else:
            self._rows.resize((more, *shape), refcheck=False)

    def rows(self) -> NDArray[Any]:
        """All rows, read-only; afterwards the buffer is empty."""
        count, self._count = self._count, 0
        if self._one is not None:
            return np.broadcast_to(self._one, (count, *self._one.shape))
        rows, self._rows = self._rows, np.empty((0, *self._rows.shape[1:]), self._rows.dtype)
        rows.resize((count, *rows.shape[1:]), refcheck=False)
        return sealed(rows)


def repeated(counts: IntArray) -> tuple[IntArray, IntArray]:
    """Owner of each of ``counts[0] + counts[1] + ...`` things, and its number among its owner's.

    Examples
    --------
    >>> repeated(np.array([2, 0, 3]))
    (array([0, 0, 2, 2, 2]), array([0, 1, 0, 1, 2]))
    """
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]


def freeze(value: object, **kinds: DTypeLike) -> None:
    """Make fields of a frozen dataclass read-only; called in its ``__post_init__``.

    Parameters
    ----------
    **kinds : data type, `tuple` or `dict`
        What each field becomes, by its name: an array of a data type, a tuple, or a read-only
        mapping. A mapping whose kind is not `dict` becomes a read-only mapping of such values. None
        stays.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Line:
    ...     points: FloatArray
    ...     patches: Mapping[str, IntArray]
    ...
    ...     def __post_init__(self) -> None:
    ...         freeze(self, points=float, patches=int)
    >>> Line([[0, 1]], {"start": [0]})
    Line(points=array([[0., 1.]]), patches=mappingproxy({'start': array([0])}))
    """
    for name, kind in kinds.items():
        object.__setattr__(value, name, _frozen(getattr(value, name), kind))


def _frozen(given: Any, kind: Any) -> Any:
    if given is None:
        return None
    if isinstance(given, Mapping):
        inner = {
            key: value if kind is dict and not isinstance(value, Mapping) else _frozen(value, kind)
            for key, value in given.items()
        }
        return MappingProxyType(inner)
    return tuple(given) if kind is tuple else read_only(given, kind)


def in_brief(value: Any) -> str:
    """Show a dataclass in one line: numbers and words as they are, arrays by their shape.

    For ``__repr__ = in_brief`` in the body of a dataclass with large fields.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Line:
    ...     name: str
    ...     points: FloatArray
    ...
    ...     __repr__ = in_brief
    >>> Line("border", np.zeros((7, 2)))
    Line(name='border', points (7, 2))
    """
    parts = []
    for name in (field.name for field in dataclasses.fields(value)):
        given = getattr(value, name)
        if isinstance(given, np.ndarray | RowBlocks):
            parts.append(f"{name} {given.shape}")
        elif given is None or isinstance(given, bool | int | str):
            parts.append(f"{name}={given!r}")
        elif isinstance(given, float):
            parts.append(f"{name}={given:.6g}")
        elif isinstance(given, tuple | list | Mapping):
            parts.append(f"{len(given)} {name}")
        else:
            parts.append(f"{name} {type(given).__name__}")
    return f"{type(value).__name__}({', '.join(parts)})"
