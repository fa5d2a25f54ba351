"""Values as bytes, to send them to other processes: arrays stay read-only, mappings too.

Classes and functions of a notebook or script are sent with their code, so that a strategy defined
in a cell runs in other processes.
"""

import io
import pickle
from types import MappingProxyType
from typing import Any

import cloudpickle
import numpy as np

__all__ = ["packed", "unpacked"]


def packed(value: Any) -> bytes:
    """Value as bytes."""
    target = io.BytesIO()
    _Pickler(target).dump(value)
    return target.getvalue()


def unpacked(data: bytes) -> Any:
    """Value of bytes that `packed` made in a process that this one trusts: its own study."""
    return pickle.loads(data)


class _Pickler(cloudpickle.Pickler):
    """Pickles what frozen dataclasses hold: a plain pickle would make arrays writable.

    Compiled functions would be compiled anew for writable arrays, and values could be changed.
    """

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, MappingProxyType):
            return _mapping, (dict(value),)
        if type(value) is np.ndarray and not value.flags.writeable and not value.dtype.hasobject:
            data = np.ascontiguousarray(value).tobytes()
            return _array, (data, value.dtype.str, value.shape)
        return super().reducer_override(value)


def _mapping(entries: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """Read-only mapping."""
    return MappingProxyType(entries)


def _array(data: bytes, kind: str, shape: tuple[int, ...]) -> Any:
    """Read-only array over bytes."""
    return np.ndarray(shape, dtype=np.dtype(kind), buffer=data)
