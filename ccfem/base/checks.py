"""Checks of parameters: one line that says what was expected and what came."""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, is_dataclass
from numbers import Real
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from ccfem.base.errors import InputError, known_names, shown

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
    at_least, above, at_most, below : float, optional
        Bounds; the value may equal `at_least` and `at_most`, not `above` and `below`.
    unit : str, optional
        Unit of the bounds in the message.

    Examples
    --------
    >>> check_number("width", 0.4, above=0.0, unit="mm")
    >>> check_number("share", 2.0, above=0.0, at_most=1.0)
    Traceback (most recent call last):
    ccfem.base.errors.InputError: share must be above 0 and at most 1; got 2.0: give one in this
    range
    """
    finite = _finite(value)
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
    raise InputError(f"{what} must be {', '.join(words)}; got {shown(value)}: {cure}")


def _finite(value: Any) -> bool:
    """Whether a value is a number that a float can hold; integers may be larger."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


@dataclass(frozen=True)
class Range:
    """Sizes that a quantity can have, and those that it usually has.

    Attributes
    ----------
    possible : tuple of 2 floats
        Beyond these no material, spring or load is: `check` refuses such a value.
    usual : tuple of 2 floats
        Of printed parts and what they carry: `about` remarks on a value beyond these.
    others : mapping of str to float
        Units that are taken for the right one by mistake, with their size in it.
    """

    unit: str
    possible: tuple[float, float]
    usual: tuple[float, float]
    others: Mapping[str, float]

    def check(self, what: str, value: float) -> None:
        """Refuse a finite value, other than 0, of an impossible size.

        Examples
        --------
        >>> MASS_DENSITY.check("mass density", 1240.0)
        Traceback (most recent call last):
        ccfem.base.errors.InputError: mass density must be 0.0001 to 30 g/cm^3; got 1240: as kg/m^3
        it \
would be 1.24 g/cm^3, so give that
        """
        if value and not self.possible[0] <= abs(value) <= self.possible[1]:
            low, high = self.possible
            raise InputError(
                f"{what} must be {low:g} to {high:g} {self.unit}; got {value:.6g}: "
                f"{self._cure(value)}"
            )

    def about(self, what: str, value: float) -> str:
        """Say that a value has an unusual size, and which unit it may be in; empty for a usual one.

        Examples
        --------
        >>> MODULUS.about("modulus", 3.5)
        'modulus is 3.5 MPa, where 5 to 1e+06 MPa are usual: as GPa it would be 3500 MPa, so give \
that'
        >>> MODULUS.about("modulus", 3500.0)
        ''
        """
        low, high = self.usual
        if not value or low <= abs(value) <= high:
            return ""
        return (
            f"{what} is {value:.6g} {self.unit}, where {low:g} to {high:g} {self.unit} are usual: "
            f"{self._cure(value)}"
        )

    def _cure(self, value: float) -> str:
        """Name the unit that makes a value a usual one."""
        for unit, size in self.others.items():
            if self.usual[0] <= abs(value) * size <= self.usual[1]:
                return f"as {unit} it would be {value * size:.4g} {self.unit}, so give that"
        return f"give it in {self.unit}"


MODULUS = Range("MPa", (1e-5, 1e8), (5.0, 1e6), {"GPa": 1e3, "Pa": 1e-6})
"""From the softest gels to a hundred times diamond; from soft elastomers to carbon fibre."""
STRENGTH = Range("MPa", (1e-5, 1e6), (0.1, 1e4), {"GPa": 1e3, "Pa": 1e-6})
MASS_DENSITY = Range("g/cm^3", (1e-4, 30.0), (0.05, 20.0), {"kg/m^3": 1e-3, "t/mm^3": 1e9})
"""From aerogel to osmium."""
EXPANSION = Range("1/K", (1e-12, 0.1), (1e-9, 1e-3), {"1e-6/K": 1e-6})
SPRING = Range("N/mm", (1e-6, 1e15), (1e-3, 1e9), {"N/m": 1e-3, "kN/mm": 1e3})
BED = Range("MPa/mm", (1e-9, 1e15), (1e-5, 1e9), {"Pa/m": 1e-9, "GPa/mm": 1e3})
FORCE = Range("N", (1e-12, 1e12), (1e-6, 1e6), {"mN": 1e-3, "kN": 1e3})
MOMENT = Range("N mm", (1e-12, 1e12), (1e-6, 1e9), {"N m": 1e3})
TRACTION = Range("MPa", (1e-12, 1e12), (1e-9, 1e4), {"Pa": 1e-6})
ACCELERATION = Range("m/s^2", (1e-12, 1e12), (1e-3, 5e3), {"mm/s^2": 1e-3})
WARMTH = Range("K", (1e-12, 1e12), (1e-6, 1e3), {})


def check_fields(value: object, *names: str, **bounds: Any) -> None:
    """Refuse a dataclass with a field that is not a finite number within bounds.

    None passes where the annotation has it. The message names a field as in ``eqs.spacing``. Bounds
    are those of `check_number`.
    """
    for name in names:
        given = getattr(value, name)
        if given is None and type(None) in get_args(get_type_hints(type(value))[name]):
            continue
        check_number(f"{member_name(value)}.{name}", given, **bounds)


def check_choices(value: object) -> None:
    """Refuse a dataclass with a field annotated as ``Literal[...]`` that holds another value."""
    for name, hint in get_type_hints(type(value)).items():
        if get_origin(hint) is Literal and getattr(value, name) not in get_args(hint):
            words = ", ".join(map(repr, get_args(hint)))
            raise InputError(
                f"{member_name(value)}.{name} must be one of {words}; got "
                f"{getattr(value, name)!r}: name one of them"
            )


def check_known(kind: str, name: str, known: Iterable[str], cure: str = "") -> None:
    """Refuse an unknown name, such as that of a material."""
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

    Examples
    --------
    >>> KnownNames("load case", {"pull": 1, "twist": 2})["bend"]
    Traceback (most recent call last):
    ccfem.base.errors.InputError: no load case named 'bend'; there are: pull, twist
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
    """Refuse a class in place of an instance of a kind, as "strategy", and what is not callable."""
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
    """Refuse keywords that a function does not have; `replaced` names what stands for some."""
    for name in unknown:
        cure = f": give it as {replaced[name]}" if name in replaced else ""
        raise InputError(
            f"{function} has no keyword '{name}'; it has: {known_names(name, known)}{cure}"
        )


def member_name(value: object) -> str:
    """Name of a value's class as modules are named: ``stream_function`` of a ``StreamFunction``."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(value).__name__).lower()
