"""Checks of parameters: one line that says what was expected and what came."""

import math
import re
from collections.abc import Iterable
from numbers import Real
from typing import Any, Literal, get_args, get_origin, get_type_hints

from ccfem.errors import InputError, known_names

__all__ = [
    "FARTHEST",
    "check_choices",
    "check_fields",
    "check_known",
    "check_number",
    "member_name",
]

FARTHEST = 1e9
"""Largest coordinate that is taken for meant, mm: a thousand kilometres."""


def check_number(
    what: str,
    value: Any,
    *,
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
    unit: str = "",
) -> None:
    """Refuse what is not a finite number within bounds.

    Parameters
    ----------
    what : str
        Name of the value in the message.
    value : number
    at_least, above, at_most, below : float, optional
        Bounds; the value may equal `at_least` and `at_most`, not `above` and `below`.
    unit : str, optional
        Unit of the bounds in the message.

    Raises
    ------
    InputError

    Examples
    --------
    >>> check_number("width", 0.4, above=0.0, unit="mm")
    >>> check_number("share", 2.0, above=0.0, at_most=1.0)
    Traceback (most recent call last):
    ccfem.errors.InputError: share must be above 0 and at most 1; got 2.0: give one in this range
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    finite = number and math.isfinite(value)
    if (
        finite
        and (at_least is None or value >= at_least)
        and (above is None or value > above)
        and (at_most is None or value <= at_most)
        and (below is None or value < below)
    ):
        return
    named = {"at least": at_least, "above": above, "at most": at_most, "below": below}
    bounds = [f"{word} {bound:g}" for word, bound in named.items() if bound is not None]
    words = [] if finite else ["a finite number"]
    if bounds:
        words.append(f"{' and '.join(bounds)} {unit}".strip())
    elif unit:
        words = [f"a finite number of {unit}"]
    cure = f"give {'one in this range' if bounds else 'a number'}"
    raise InputError(f"{what} must be {', '.join(words)}; got {value!r}: {cure}")


def check_fields(value: object, *names: str, **bounds: Any) -> None:
    """Refuse a dataclass with a field that is not a finite number within bounds.

    None passes where the annotation has it. The message names a field as in ``eqs.spacing``.

    Parameters
    ----------
    value : dataclass
    *names : str
        The fields.
    **bounds
        `at_least`, `above`, `at_most`, `below` and `unit` of `check_number`.

    Raises
    ------
    InputError
    """
    for name in names:
        given = getattr(value, name)
        if given is None and type(None) in get_args(get_type_hints(type(value))[name]):
            continue
        check_number(f"{member_name(value)}.{name}", given, **bounds)


def check_choices(value: object) -> None:
    """Refuse a dataclass with a field annotated as ``Literal[...]`` that holds none of its values.

    Raises
    ------
    InputError
        With the values that the field may hold.
    """
    for name, hint in get_type_hints(type(value)).items():
        if get_origin(hint) is Literal and getattr(value, name) not in get_args(hint):
            words = ", ".join(map(repr, get_args(hint)))
            raise InputError(
                f"{member_name(value)}.{name} must be one of {words}; got "
                f"{getattr(value, name)!r}: name one of them"
            )


def check_known(kind: str, name: str, known: Iterable[str], cure: str = "") -> None:
    """Refuse an unknown name, such as that of a material.

    Raises
    ------
    InputError
        With the known names, and what to do otherwise where `cure` says it.
    """
    names = list(known)
    if name not in names:
        there = known_names(name, names) or "none"
        raise InputError(f"no {kind} named '{name}'; there are: {there}{cure and f' ({cure})'}")


def member_name(value: object) -> str:
    """Name of a value's class as modules are named: ``stream_function`` of a ``StreamFunction``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(value).__name__).lower()
