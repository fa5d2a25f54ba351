"""The supports, loads and combinations of a part file: tables to values."""

from collections.abc import Callable, Mapping

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError, Mistakes, known_names, shown
from ccfem.base.toml import TomlTable, cure_of, from_table
from ccfem.cases.part_tables import named_table
from ccfem.fem.elasticity import load_kinds, support_kinds

LOADS: dict[str, Callable[..., load_kinds.Load]] = {
    "force": load_kinds.Force,
    "traction": load_kinds.Traction,
    "pressure": load_kinds.Pressure,
    "bearing": load_kinds.Bearing,
    "moment": load_kinds.Moment,
    "point": load_kinds.PointForce,
    "nodes": load_kinds.NodeForces,
    "body_force": load_kinds.BodyForce,
    "gravity": load_kinds.Gravity,
    "centrifugal": load_kinds.Centrifugal,
    "temperature": load_kinds.Temperature,
    "displacement": load_kinds.Displacement,
}
"""Loads by their kind."""

_HELD, _CASE = "held", "case"
SUPPORTS: dict[str, Callable[..., support_kinds.AnySupport]] = {
    _HELD: support_kinds.Support,
    "edge": support_kinds.EdgeSupport,
    "point": support_kinds.PointSupport,
    "nodes": support_kinds.NodeSupport,
    "local": support_kinds.LocalSupport,
    "sliding": support_kinds.SlidingSupport,
    "rigid": support_kinds.RigidPatch,
    "pin": support_kinds.Pin,
    "spring": support_kinds.Spring,
    "point_spring": support_kinds.PointSpring,
    "foundation": support_kinds.Foundation,
    "pressing": support_kinds.PressingSupport,
    "tied": support_kinds.TiedPatch,
}
"""Supports by their kind."""


def supports_of(
    tables: tuple[TomlTable, ...], cases: TomlTable, mistakes: Mistakes
) -> tuple[tuple[support_kinds.AnySupport, ...], dict[str, tuple[support_kinds.AnySupport, ...]]]:
    """Supports of the tables [[supports]]: those of all load cases, and those of each alone.

    One without a kind holds its patch; one with ``case`` holds in the load cases named alone. What
    is wrong is noted.
    """
    if not tables:
        mistakes.lines.append("a part needs a support: add [[supports]] with its patch")
    always: list[support_kinds.AnySupport] = []
    in_case: dict[str, tuple[support_kinds.AnySupport, ...]] = {}
    for k, table in enumerate(tables):
        with mistakes.noted():
            names = _cases_of(table, cases, f"supports[{k}]")
            rest = {key: value for key, value in table.items() if key != _CASE}
            support = _support(rest, f"supports[{k}]")
            if not names:
                always.append(support)
            for name in names:
                in_case[name] = (*in_case.get(name, ()), support)
    return tuple(always), in_case


def _cases_of(table: TomlTable, cases: TomlTable, where: str) -> tuple[str, ...]:
    """Load cases that a support holds in; none where it holds in all."""
    if _CASE not in table:
        return ()
    given = table[_CASE]
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(
            f"{where}.case must be the name of a load case, or a list of names; got "
            f"{shown(given)}: name some, or leave it out for a support in all load cases"
        )
    for name in names:
        if name not in cases:
            raise InputError(
                f"{where}.case names no load case '{name}'; there are: {known_names(name, cases)}"
            )
    return tuple(dict.fromkeys(names))


def alternative_supports_of(
    tables: tuple[TomlTable, ...], mistakes: Mistakes
) -> tuple[support_kinds.AnySupport, ...]:
    """Supports of the tables [[alternative_supports]], if any; what is wrong is noted."""
    supports: list[support_kinds.AnySupport] = []
    for k, table in enumerate(tables):
        with mistakes.noted():
            supports.append(_support(table, f"alternative_supports[{k}]"))
    return tuple(supports)


def _support(table: TomlTable, where: str) -> support_kinds.AnySupport:
    kind, rest = named_table({"kind": _HELD, **table}, "kind", SUPPORTS, where)
    return from_table(SUPPORTS[kind], rest, where)


def loads_of(cases: TomlTable, mistakes: Mistakes) -> dict[str, tuple[load_kinds.Load, ...]]:
    """Read the loads of every load case, of the tables [[loads.NAME]]; what is wrong is noted.

    A case without loads, ``NAME = []``, is one in which supports alone move.
    """
    if not cases:
        mistakes.lines.append("a part needs a load: add [[loads.NAME]] with its kind")
    loads: dict[str, tuple[load_kinds.Load, ...]] = {}
    for name, tables in cases.items():
        if not isinstance(tables, list):
            mistakes.lines.append(
                f"loads.{name} must be a list of tables; got {shown(tables)}: write "
                f"[[loads.{name}]]"
            )
            continue
        loads[name] = ()
        for k, table in enumerate(tables):
            with mistakes.noted():
                where = f"loads.{name}[{k}]"
                kind, rest = named_table(table, "kind", LOADS, where)
                load = from_table(LOADS[kind], rest, where)
                loads[name] = (*loads[name], load)
    return loads


def combinations_of(
    tables: TomlTable, cases: TomlTable, mistakes: Mistakes
) -> dict[str, dict[str, float]]:
    """Factors of load cases, of the tables [combinations.NAME]; what is wrong is noted."""
    combinations = {}
    for name, table in tables.items():
        with mistakes.noted():
            combinations[name] = _factors(name, table, cases)
    return combinations


def _factors(name: str, table: object, cases: TomlTable) -> dict[str, float]:
    """Factors of the load cases in one combination."""
    where = f"combinations.{name}"
    if not isinstance(table, Mapping) or not table:
        raise InputError(
            f"{where} must be a table of load cases with their factors; got {shown(table)}: write "
            f"[{where}] and NAME = FACTOR"
        )
    for case, factor in table.items():
        if case not in cases:
            raise InputError(
                f"{where} names no load case '{case}'; there are: {known_names(case, cases)}"
            )
        if isinstance(factor, bool) or not isinstance(factor, int | float):
            raise InputError(
                f"{where}.{case} must be a number; got {shown(factor)}: {cure_of(factor, float)}"
            )
        if not abs(factor) < 1e300:
            raise InputError(f"{where}.{case} must be finite; got {shown(factor)}: give a number")
    if name in cases:
        raise InputError(f"{where} has the name of a load case: rename one of them")
    return {case: float(factor) for case, factor in table.items()}


def weights_of(table: TomlTable, cases: TomlTable, mistakes: Mistakes) -> dict[str, float]:
    """Weights of load cases and combinations, of the table [weights]; what is wrong is noted."""
    weights = {}
    for name, weight in table.items():
        with mistakes.noted():
            if name not in cases:
                raise InputError(
                    f"weights names no load case '{name}'; there are: {known_names(name, cases)}"
                )
            check_number(f"weights.{name}", weight, above=0.0)
            weights[name] = float(weight)
    return weights
