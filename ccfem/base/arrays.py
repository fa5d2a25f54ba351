"""Array types, and read-only arrays and mappings for frozen dataclasses."""

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]


def read_only(values: ArrayLike, dtype: DTypeLike = float) -> NDArray[Any]:
    """Return `values` as a C-contiguous array that nobody can write to.

    They are copied unless they are such an array of the right type already.
    """
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
        if isinstance(given, np.ndarray):
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
