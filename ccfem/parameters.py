"""Parameters that come as text or from a file: reading them, and checking their type."""

import tomllib
from typing import Any

from ccfem.errors import InputError

__all__ = ["check_type", "parse_assignment"]

_KINDS = (
    (bool, bool, "true or false"),
    (int, int, "a whole number"),
    (float, (int, float), "a number"),
    (str, str, "a string"),
    (tuple, tuple, "a list"),
)


def parse_assignment(text: str) -> tuple[str, Any]:
    """Split ``name=value``; the value is read as TOML, or else as a plain string.

    Raises
    ------
    InputError
        When there is no name or no equals sign.

    Examples
    --------
    >>> parse_assignment("cap=90.5"), parse_assignment("fit=literal")
    (('cap', 90.5), ('fit', 'literal'))
    """
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not name:
        raise InputError(f"expected NAME=VALUE; got '{text}': write for example cap=90")
    try:
        return name, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return name, value


def check_type(what: str, value: object, default: object) -> None:
    """Refuse a value of another type than its default; a default of any other type takes any.

    Parameters
    ----------
    what : str
        Name of the parameter, for the message.
    value, default

    Raises
    ------
    InputError
        For a value of a wrong type.
    """
    for kind, allowed, word in _KINDS:
        if isinstance(default, kind):
            if not isinstance(value, allowed) or isinstance(value, bool) != (kind is bool):
                raise InputError(f"{what} must be {word}, as {default!r}; got {value!r}")
            return
