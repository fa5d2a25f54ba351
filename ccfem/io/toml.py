"""Tables of a TOML file to values: keys by name, types by annotation, nothing else accepted."""

import dataclasses
import inspect
import math
import re
import tomllib
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from ccfem.errors import InputError, Mistakes, known_names, shown

__all__ = ["assignment", "described", "from_table"]

T = TypeVar("T")

_POINTED = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?")
"""A number with no digit on one side of its point, which TOML does not know."""

_WORDS: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    bool: "true or false",
    str: "a string",
    type(None): "left out",
}


def from_table(make: Callable[..., T], table: object, where: str, infinite: bool = False) -> T:
    """Call `make` with the entries of a table as keyword arguments.

    Parameters
    ----------
    make : dataclass or function
        Its parameters name the keys, their annotations the types: numbers, strings, booleans,
        literals, tuples (written as lists), dictionaries and dataclasses (written as tables) and
        unions of these.
    table : object
        What stands in the file.
    where : str
        Place in the file, for the messages.
    infinite : bool, default False
        Whether numbers may be infinite.

    Raises
    ------
    InputError
        For something that is no table, an unknown or a missing key (the known ones are listed), a
        value of another type, or whatever `make` refuses; all mistakes of the table at once.
    """
    if not isinstance(table, Mapping):
        raise InputError(
            f"{where} must be a table; got {shown(table)}: write [{where}] and its keys"
        )
    parameters = inspect.signature(make).parameters
    hints = typing.get_type_hints(make)
    found, values = Mistakes(), {}
    for key in table:
        if key not in parameters:
            found.lines.append(
                f"{where} has no key '{key}'; it has: {known_names(str(key), parameters)}"
            )
    for name, parameter in parameters.items():
        if name in table:
            with found.noted():
                values[name] = _converted(table[name], hints[name], f"{where}.{name}", infinite)
        elif parameter.default is inspect.Parameter.empty:
            found.lines.append(
                f"{where} needs the key '{name}'; its keys are: {', '.join(parameters)}"
            )
    found.complain()
    try:
        return make(**values)
    except InputError as error:
        raise InputError(*(f"{where}: {line}" for line in error.mistakes)) from None


def _converted(value: object, hint: Any, where: str, infinite: bool) -> Any:
    """Value as the annotation wants it, or an error that says what it wants."""
    union = get_origin(hint) in (Union, types.UnionType)
    for option in get_args(hint) if union else (hint,):
        if isinstance(value, Mapping) and _is_dataclass(option):
            return from_table(option, value, where, infinite)
    found = _fitted(value, hint, infinite)
    if found is _UNFIT:
        raise InputError(f"{where} must be {described(hint)}; got {shown(value)}: correct it")
    return found


def _is_dataclass(hint: Any) -> bool:
    return isinstance(hint, type) and dataclasses.is_dataclass(hint)


_UNFIT = object()


def _fitted(value: Any, hint: Any, infinite: bool) -> Any:
    """Value as the annotation wants it, or `_UNFIT`."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        fits = (_fitted(value, option, infinite) for option in arguments)
        return next((fit for fit in fits if fit is not _UNFIT), _UNFIT)
    if origin is Literal:
        same = any(value == option and type(value) is type(option) for option in arguments)
        return value if same else _UNFIT
    if origin is tuple:
        if not isinstance(value, list):
            return _UNFIT
        options = arguments[:1] * len(value) if arguments[-1] is Ellipsis else arguments
        if len(options) != len(value):
            return _UNFIT
        parts = [_fitted(v, option, infinite) for v, option in zip(value, options, strict=True)]
        return _UNFIT if any(part is _UNFIT for part in parts) else tuple(parts)
    if origin in (dict, Mapping):
        return dict(value) if isinstance(value, Mapping) else _UNFIT
    if hint in (int, float, bool, str):
        return _plain(value, hint, infinite)
    return _UNFIT


def _plain(value: Any, hint: Any, infinite: bool) -> Any:
    """Take a number, string or boolean of the wanted type, or `_UNFIT`."""
    if isinstance(value, bool) or hint is bool:
        return value if hint is bool and isinstance(value, bool) else _UNFIT
    if hint in (str, int):
        return value if isinstance(value, hint) else _UNFIT
    if not isinstance(value, int | float) or value != value:
        return _UNFIT
    try:
        number = float(value)
    except OverflowError:
        return _UNFIT
    return number if infinite or math.isfinite(number) else _UNFIT


def described(hint: Any) -> str:
    """Words for what an annotation takes, as "a list of 3, each a number"."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        wanted = [option for option in arguments if option is not type(None)]
        return " or ".join(described(option) for option in wanted)
    if origin is Literal:
        return "one of " + ", ".join(repr(option) for option in arguments)
    if origin is tuple and arguments[-1] is Ellipsis:
        return f"a list, each item {described(arguments[0])}"
    if origin is tuple:
        return f"a list of {len(arguments)}, each {described(arguments[0])}"
    if origin is dict or _is_dataclass(hint):
        return "a table"
    return _WORDS.get(hint, str(hint))


def assignment(text: str) -> tuple[str, Any]:
    """Split ``name=value``; the value is read as TOML, or else as a plain string.

    Numbers may leave the nought before or after their point out, as in ``.5``.
    """
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not name:
        raise InputError(f"expected NAME=VALUE; got '{text}': write for example cap=90")
    try:
        return name, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return name, float(value) if _POINTED.fullmatch(value) else value
