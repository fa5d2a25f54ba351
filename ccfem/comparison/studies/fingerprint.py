"""Fingerprints of values: the same for the same content, whoever computes them and when."""

import dataclasses
import hashlib
from collections.abc import Iterable, Mapping
from pathlib import PurePath
from types import CodeType, FunctionType
from typing import Any

import numpy as np

from ccfem.base.errors import InputError
from ccfem.base.row_blocks import RowBlocks


def fingerprint(*values: Any) -> str:
    """Hash of values by what they hold: arrays, numbers, words, dataclasses, mappings, sequences.

    A class that does not come with ccfem, such as a strategy of a notebook, counts with the code
    of its functions and of those beside it that they call: when that changes, so does the hash.

    Parameters
    ----------
    *values

    Returns
    -------
    str
        40 hexadecimal digits of SHA-256.

    Raises
    ------
    InputError
        For a value whose content cannot be known, such as an open file.

    Examples
    --------
    >>> fingerprint({"a": 1.0, "b": 2}) == fingerprint({"b": 2, "a": 1.0})
    True
    >>> fingerprint(1.0) == fingerprint(1)
    False
    """
    digest = hashlib.sha256()
    for piece in _encoded(values, ()):
        digest.update(len(piece).to_bytes(8, "little"))
        digest.update(piece)
    return digest.hexdigest()[:40]


def _encoded(value: Any, inside: tuple[int, ...]) -> Iterable[bytes]:
    """Bytes that stand for a value."""
    if isinstance(value, RowBlocks):
        value = np.asarray(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, np.generic):
        yield from _encoded(value.item(), inside)
    elif value is None or isinstance(value, bool | int | str | bytes):
        yield f"{type(value).__name__} {value!r}".encode()
    elif isinstance(value, float):
        yield f"float {value.hex()}".encode()
    elif isinstance(value, PurePath):
        yield f"path {value}".encode()
    elif isinstance(value, type):
        yield from _type_pieces(value, inside)
    elif isinstance(value, FunctionType):
        yield from _function_pieces(value, inside)
    elif isinstance(value, CodeType):
        yield f"code {value.co_names} {value.co_varnames}".encode()
        yield value.co_code
        yield from _encoded(value.co_consts, inside)
    elif dataclasses.is_dataclass(value):
        yield from _type_pieces(type(value), inside)
        for field in dataclasses.fields(value):
            yield field.name.encode()
            yield from _encoded(getattr(value, field.name), inside)
    elif isinstance(value, Mapping):
        yield f"mapping {len(value)}".encode()
        for key in sorted(value, key=str):
            yield from _encoded(key, inside)
            yield from _encoded(value[key], inside)
    elif isinstance(value, tuple | list):
        yield f"sequence {len(value)}".encode()
        for part in value:
            yield from _encoded(part, inside)
    elif isinstance(value, frozenset | set):
        yield from _encoded(sorted(value, key=repr), inside)
    elif hasattr(value, "__dict__"):
        yield from _type_pieces(type(value), inside)
        yield from _encoded(vars(value), inside)
    else:
        raise InputError(
            f"a study tells runs apart by their content, and cannot look into a "
            f"{type(value).__name__}: give numbers, words, arrays or dataclasses"
        )


def _ours(module: str) -> bool:
    return module == "ccfem" or module.startswith("ccfem.")


def _type_pieces(kind: type, inside: tuple[int, ...]) -> Iterable[bytes]:
    """Name of a class; of one that does not come with ccfem, its code too."""
    yield f"class {kind.__module__}.{kind.__qualname__}".encode()
    if _ours(kind.__module__) or kind.__module__ == "builtins" or id(kind) in inside:
        return
    for name, member in sorted(vars(kind).items()):
        member = getattr(member, "fget", None) or getattr(member, "__func__", member)
        # What `dataclass` makes itself follows from the fields, which are here as values.
        made = name.startswith("__") and name not in ("__call__", "__post_init__")
        if isinstance(member, FunctionType) and not made:
            yield name.encode()
            yield from _function_pieces(member, (*inside, id(kind)))


def _function_pieces(function: FunctionType, inside: tuple[int, ...]) -> Iterable[bytes]:
    """Name of a function; of one that does not come with ccfem, its code and that beside it."""
    yield f"function {function.__module__}.{function.__qualname__}".encode()
    if _ours(function.__module__) or id(function) in inside:
        return
    inside = (*inside, id(function))
    yield from _encoded(function.__code__, inside)
    for name in _names(function.__code__):
        other = function.__globals__.get(name)
        beside = getattr(other, "__module__", None) == function.__module__
        if isinstance(other, FunctionType | type) and beside:
            yield from _encoded(other, inside)
        elif isinstance(other, bool | int | float | str | np.ndarray):
            yield name.encode()
            yield from _encoded(other, inside)


def _names(code: CodeType) -> list[str]:
    """Names of globals that code may use, that of inner functions included."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names.update(_names(constant))
    return sorted(names)
