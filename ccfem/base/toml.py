"""Tables of a TOML file to values: keys by name, types by annotation, nothing else accepted."""

import dataclasses
import inspect
import math
import os
import re
import tomllib
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any, Literal, TypeVar, Union, get_args, get_origin

from ccfem.base.errors import InputError, Mistakes, known_names, shown
from ccfem.base.whole import text_of

T = TypeVar("T")

_POINTED = re.compile(r"[+-]?(\.\d+|\d+\.)([eE][+-]?\d+)?")
"""A number with no digit on one side of its point, which TOML does not know."""

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\d\s.,]*)\s*")
"""A number and its unit, in a string."""
_UNITS = {
    "mm": (1.0, "mm"),
    "cm": (10.0, "mm"),
    "m": (1e3, "mm"),
    "um": (1e-3, "mm"),
    "µm": (1e-3, "mm"),
    "in": (25.4, "mm"),
    '"': (25.4, "mm"),
    "N": (1.0, "N"),
    "kN": (1e3, "N"),
    "MPa": (1.0, "MPa"),
    "GPa": (1e3, "MPa"),
    "kPa": (1e-3, "MPa"),
    "Pa": (1e-6, "MPa"),
    "deg": (1.0, "degrees"),
    "°": (1.0, "degrees"),
}
"""What a unit is worth in that of ccfem."""

_MISTAKES = (
    (r"Unescaped|hex value", "write paths with / or in single quotes, where \\ stands for itself"),
    (r"Unterminated|Illegal character '\\n'|multiline", "close the quotes"),
    (r"Expected newline", "write KEY = VALUE, a line each; numbers have a point and no unit"),
    (r"Invalid value", "write text in quotes, numbers with a point and digits on both sides of it"),
    (r"Expected '='|Invalid statement|key part", "write KEY = VALUE, [TABLE] or # remark"),
    (r"overwrite|twice|[Dd]uplicate|mutate|redefine", "keep one of the two, or write [[TABLE]]"),
    (r"limit|recursion", "write shorter numbers, and fewer brackets in brackets"),
    (r"Unclosed|[Cc]lose|Expected '\]|inline table", "close the bracket"),
)
"""What the parser says, and what helps."""

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
    mistakes, values = Mistakes(), {}
    for key in table:
        if key not in parameters:
            mistakes.lines.append(
                f"{where} has no key '{key}'; it has: {known_names(str(key), parameters)}"
            )
    for name, parameter in parameters.items():
        if name in table:
            with mistakes.noted():
                values[name] = _converted(table[name], hints[name], f"{where}.{name}", infinite)
        elif parameter.default is inspect.Parameter.empty:
            mistakes.lines.append(
                f"{where} needs the key '{name}'; its keys are: {', '.join(parameters)}"
            )
    mistakes.complain()
    try:
        return make(**values)
    except InputError as error:
        raise InputError(*(f"{where}: {line}" for line in error.mistakes)) from None


TomlTable = Mapping[str, Any]
"""A table as TOML holds it: texts, numbers, lists and tables by key."""


def read_toml(path: str | os.PathLike[str], what: str) -> dict[str, Any]:
    """Read a TOML file."""
    return toml_of(text_of(path, what), f"{what} {path}")


def toml_of(text: str, what: str) -> dict[str, Any]:
    """Content of a text in TOML, as `read_toml` reads it; `what` names it in messages."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        message = str(error)
    at = re.search(r"line (\d+)", message)
    lines = text.splitlines()
    line = lines[min(int(at[1]), len(lines)) - 1].strip() if at and lines else ""
    cures = (cure for pattern, cure in _MISTAKES if re.search(pattern, message))
    raise InputError(
        f"{what} is not a TOML file: {message}"
        + (f", '{line}'" if line.isprintable() and 0 < len(line) < 100 else "")
        + f": {next(cures, 'start from ccfem example bracket_plate')}"
    )


def _converted(value: object, hint: Any, where: str, infinite: bool) -> Any:
    """Value as the annotation wants it, or an error that says what it wants."""
    union = get_origin(hint) in (Union, types.UnionType)
    for option in get_args(hint) if union else (hint,):
        if isinstance(value, Mapping) and _is_dataclass(option):
            return from_table(option, value, where, infinite)
    converted = _fitted(value, hint, infinite)
    if converted is _UNFIT:
        raise InputError(
            f"{where} must be {described(hint)}; got {shown(value)}: {cure_of(value, hint)}"
        )
    return converted


def cure_of(value: object, hint: Any) -> str:
    """Say how a value that does not fit an annotation is to be written.

    Examples
    --------
    >>> cure_of("2.5 mm", float)
    'write 2.5 without quotes and unit, in mm'
    >>> cure_of("3 cm", float), cure_of("x", float)
    ('write 30 without quotes and unit, in mm', 'write the bare number, as 2.5')
    >>> cure_of([0, "1", 2], tuple[float, float, float])
    'write 1 without quotes'
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        options = [option for option in arguments if option is not type(None)]
        lists = [option for option in options if get_origin(option) is tuple]
        return cure_of(value, lists[0] if lists and isinstance(value, list) else options[0])
    if origin is tuple and isinstance(value, list):
        fixed = arguments[-1] is not Ellipsis
        if fixed and len(value) != len(arguments):
            return f"give it {len(arguments)} items"
        items = zip(value, arguments if fixed else arguments[:1] * len(value), strict=True)
        # Whatever does not fit by itself; infinity is for boxes.
        wrong = (item for item in items if _fitted(*item, infinite=False) is _UNFIT)
        return cure_of(*next(wrong))
    if origin is tuple:
        return "write its items in brackets, with commas between them"
    if origin is Literal:
        return "name one of these"
    if hint is float:
        return _bare_number(value)
    return {
        int: "write a whole number, without quotes, point and unit",
        bool: "write true or false without quotes",
        str: "write it in quotes",
    }.get(hint, "write a table, its keys in braces or below its name in brackets")


def _bare_number(value: object) -> str:
    """Cure of what is no finite number, a number with its unit in the first place."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "give a finite number"
    quantity = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if quantity is None or re.search(r",\d{3}\b", quantity[0]):  # 1,000 may be a thousand
        return "write the bare number, as 2.5"
    number, unit = float(quantity[1].replace(",", ".")), quantity[2]
    if unit in _UNITS:
        factor, wanted = _UNITS[unit]
        return f"write {number * factor:.12g} without quotes and unit, in {wanted}"
    return f"write {number:.12g} without quotes" + (" and unit" if unit else "")


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
