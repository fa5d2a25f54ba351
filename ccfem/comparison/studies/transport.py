"""Values as bytes, to send them to other processes: arrays stay read-only, mappings too.

Classes and functions of a notebook or script are sent with their code, so that a strategy defined
in a cell runs in other processes. Such bytes can run any code where they are read: they go through
pipes to processes of ccfem's own, and to the workers of a cluster, never through files. What is
kept in files are plain arrays.
"""

import io
import pickle
from collections.abc import Mapping
from typing import Any

import cloudpickle
import numpy as np
from numpy.typing import NDArray

from ccfem.base.parallel import ReadOnlyPickler

Parted = tuple[bytes, Mapping[str, NDArray[Any]]]
"""A value as bytes without its arrays, and the arrays by name: for `unpacked`."""


def packed(value: Any) -> bytes:
    """Value as bytes."""
    target = io.BytesIO()
    _Pickler(target).dump(value)
    return target.getvalue()


def parted(value: Any) -> Parted:
    """Value as bytes, its read-only arrays apart."""
    target = io.BytesIO()
    pickler = _PartingPickler(target)
    pickler.dump(value)
    return target.getvalue(), dict(pickler.arrays)


def unpacked(data: bytes, arrays: Mapping[str, NDArray[Any]] | None = None) -> Any:
    """Value of bytes that `packed` or `parted` made in a process that this one trusts."""
    return _Unpickler(io.BytesIO(data), arrays or {}).load()


def _is_plain(value: Any) -> bool:
    """Whether a value is an array whose content is all that there is to it."""
    return type(value) is np.ndarray and not value.flags.writeable and not value.dtype.hasobject


class _Pickler(ReadOnlyPickler, cloudpickle.Pickler):
    """Pickles what frozen dataclasses hold: a plain pickle would make arrays writable.

    Compiled functions would be compiled anew for writable arrays, and values could be changed.
    """


class _PartingPickler(_Pickler):
    """Leaves arrays out, and keeps each once."""

    def __init__(self, target: io.BytesIO) -> None:
        super().__init__(target)
        self.arrays: dict[str, NDArray[Any]] = {}
        self._kept: dict[int, tuple[str, Any]] = {}

    def persistent_id(self, value: Any) -> str | None:
        if not _is_plain(value) or value.dtype.names is not None:
            return None
        name, _ = self._kept.setdefault(id(value), (f"a{len(self._kept)}", value))
        self.arrays[name] = np.ascontiguousarray(value).reshape(value.shape)
        return name


class _Unpickler(pickle.Unpickler):
    """Puts arrays back that were left out."""

    def __init__(self, data: io.BytesIO, arrays: Mapping[str, NDArray[Any]]) -> None:
        super().__init__(data)
        self._arrays = arrays

    def persistent_load(self, name: str) -> Any:
        array = self._arrays[name]
        array.flags.writeable = False
        return array
