"""Checks of parameters: one line that says what was expected and what came."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from numbers import Real
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from ccfem.errors import InputError, known_names, shown

__all__ = [
    "FARTHEST",
    "KnownNames",
    "check_choices",
    "check_fields",
    "check_instance",
    "check_known",
    "check_number",
    "member_name",
    "refuse_keywords",
]

V = TypeVar("V")

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


class KnownNames(dict[str, V]):
    """Values by name: an unknown name raises `InputError` with the known ones.

    Parameters
    ----------
    kind : str
        What a name stands for in the message, as "load case".
    values : mapping

    Examples
    --------
    >>> KnownNames("load case", {"pull": 1, "twist": 2})["bend"]
    Traceback (most recent call last):
    ccfem.errors.InputError: no load case named 'bend'; there are: pull, twist
    """

    def __init__(self, kind: str, values: Mapping[str, V]) -> None:
        super().__init__(values)
        self.kind = kind

    def __missing__(self, name: object) -> V:
        raise InputError(
            f"no {self.kind} named {name!r}; there are: {known_names(str(name), self) or 'none'}"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return KnownNames, (self.kind, dict(self))


def check_instance(kind: str, value: object) -> None:
    """Refuse a class in place of an instance of it, and what cannot be called.

    Parameters
    ----------
    kind : str
        What is expected, as "strategy".
    value : object

    Raises
    ------
    InputError
    """
    if isinstance(value, type):
        raise InputError(
            f"a {kind} must be an instance; got the class {value.__name__}: write "
            f"{value.__name__}()"
        )
    if not callable(value) and not is_dataclass(value):
        raise InputError(
            f"a {kind} must be a name or an object of a dataclass; got {shown(value)}: give one"
        )


def refuse_keywords(
    function: str, unknown: Iterable[str], known: Iterable[str], replaced: Mapping[str, str]
) -> None:
    """Refuse keywords that a function does not have.

    Parameters
    ----------
    function : str
    unknown, known : iterable of str
        What was given beyond its keywords, and these.
    replaced : mapping of str to str
        What takes the place of a keyword that might be expected.

    Raises
    ------
    InputError
    """
    for name in unknown:
        cure = f": give it as {replaced[name]}" if name in replaced else ""
        raise InputError(
            f"{function} has no keyword '{name}'; it has: {known_names(name, known)}{cure}"
        )


def member_name(value: object) -> str:
    """Name of a value's class as modules are named: ``stream_function`` of a ``StreamFunction``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(value).__name__).lower()
