"""Sweeps: one entry of a study, and the variants that it stands for."""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ccfem.base.errors import InputError, shown


class Variant(NamedTuple):
    """A name with parameters.

    Attributes
    ----------
    name : str
        Of a case, part file, slicer or strategy.
    parameters : dict
    """

    name: str
    parameters: dict[str, Any]


def variants(entry: str | Mapping[str, Any], where: str) -> list[Variant]:
    """List the variants of an entry.

    Parameters
    ----------
    entry : str or mapping
        A name, or ``name``, parameters, and ``sweep``: a table of lists, of which every
        combination is one variant (a grid), or a list of tables, of which each is one.
    where : str
        Place in the study, for the messages.

    Raises
    ------
    InputError
        For an entry without a name, a sweep without values, one that is neither a table of lists
        nor a list of tables, and one over a parameter that has a value already.

    Examples
    --------
    >>> entry = {"name": "isocurve", "cap": 90.0, "sweep": {"density": [1.0, 2.0]}}
    >>> [each.parameters for each in variants(entry, "strategies")]
    [{'cap': 90.0, 'density': 1.0}, {'cap': 90.0, 'density': 2.0}]
    """
    if isinstance(entry, str):
        entry = {"name": entry}
    if not isinstance(entry, Mapping) or not isinstance(entry.get("name"), str):
        raise InputError(
            f"{where} must be a name, or a table with name, parameters and sweep; got "
            f"{shown(entry)}: give its name"
        )
    fixed = {key: value for key, value in entry.items() if key not in ("name", "sweep")}
    where = f"{where} '{entry['name']}'"
    if "sweep" not in entry:
        return [Variant(entry["name"], fixed)]
    found = []
    for values in _swept(entry["sweep"], where):
        twice = sorted(set(values) & set(fixed))
        if twice:
            raise InputError(
                f"{where} has a value and a sweep of '{twice[0]}': drop one of the two"
            )
        found.append(Variant(entry["name"], {**fixed, **_nested(values)}))
    return found


def _swept(sweep: object, where: str) -> Iterator[dict[str, Any]]:
    """Values of each variant of a sweep, by their parameters."""
    if isinstance(sweep, list | tuple):
        if not sweep or not all(isinstance(each, Mapping) and each for each in sweep):
            raise InputError(
                f"sweep of {where} must be a table of lists or a list of tables; got "
                f"{shown(sweep)}: write sweep.NAME = [..] or sweep = [{{NAME = ..}}, ..]"
            )
        yield from (dict(each) for each in sweep)
        return
    axes = dict(_axes(sweep, where, ""))
    for values in itertools.product(*axes.values()):
        yield dict(zip(axes, values, strict=True))


def _axes(sweep: object, where: str, outer: str) -> Iterator[tuple[str, list[Any]]]:
    """Parameters of a grid with their values; those of inner tables with dots."""
    if not isinstance(sweep, Mapping) or not sweep:
        raise InputError(
            f"sweep of {where} must be a table of lists or a list of tables; got "
            f"{shown(sweep)}: write sweep.NAME = [..]"
        )
    for name, values in sweep.items():
        if isinstance(values, Mapping):
            yield from _axes(values, where, f"{outer}{name}.")
            continue
        if not isinstance(values, list | tuple) or not values:
            raise InputError(
                f"sweep.{outer}{name} of {where} must be a list of at least one value; got "
                f"{shown(values)}: list the values"
            )
        yield f"{outer}{name}", list(values)


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of names with dots."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        *outer, last = name.split(".")
        table = found
        for key in outer:
            table = table.setdefault(key, {})
        table[last] = value
    return found
