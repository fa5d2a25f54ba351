"""The supports, loads and combinations of a part file: tables to values."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ccfem.cases.part_tables import split
from ccfem.elasticity.load_kinds import (
    Bearing,
    BodyForce,
    Displacement,
    Force,
    Gravity,
    Load,
    PointForce,
    Pressure,
    Temperature,
    Traction,
)
from ccfem.elasticity.support_kinds import (
    AnySupport,
    EdgeSupport,
    Foundation,
    Pin,
    PointSpring,
    PointSupport,
    PressingSupport,
    RigidPatch,
    SlidingSupport,
    Spring,
    Support,
)
from ccfem.errors import InputError, known_names
from ccfem.io.toml import from_table

__all__ = ["LOADS", "SUPPORTS", "read_combinations", "read_loads", "read_supports"]

LOADS: dict[str, Callable[..., Load]] = {
    "force": Force,
    "traction": Traction,
    "pressure": Pressure,
    "bearing": Bearing,
    "point": PointForce,
    "body_force": BodyForce,
    "gravity": Gravity,
    "temperature": Temperature,
    "displacement": Displacement,
}
"""Loads by their kind."""

_HELD = "held"
SUPPORTS: dict[str, Callable[..., AnySupport]] = {
    _HELD: Support,
    "edge": EdgeSupport,
    "point": PointSupport,
    "sliding": SlidingSupport,
    "rigid": RigidPatch,
    "pin": Pin,
    "spring": Spring,
    "point_spring": PointSpring,
    "foundation": Foundation,
    "pressing": PressingSupport,
}
"""Supports by their kind."""


def read_supports(
    tables: tuple[dict[str, Any], ...], key: str = "supports"
) -> tuple[AnySupport, ...]:
    """Read the tables of supports under a key; one without a kind holds its patch.

    Raises
    ------
    InputError
    """
    if not tables and key == "supports":
        raise InputError("a part needs a support: add [[supports]] with its patch")
    found = []
    for k, table in enumerate(tables):
        where = f"{key}[{k}]"
        kind, rest = split({"kind": _HELD, **table}, "kind", SUPPORTS, where)
        found.append(from_table(SUPPORTS[kind], rest, where))
    return tuple(found)


def read_loads(cases: Mapping[str, Any]) -> dict[str, tuple[Load, ...]]:
    """Read the tables ``[[loads.NAME]]`` of every load case.

    Raises
    ------
    InputError
    """
    if not cases:
        raise InputError("a part needs a load: add [[loads.NAME]] with its kind")
    found = {}
    for name, tables in cases.items():
        if not isinstance(tables, list) or not tables:
            raise InputError(
                f"loads.{name} must be a list of tables; got {tables!r}: write [[loads.{name}]]"
            )
        loads = []
        for k, table in enumerate(tables):
            where = f"loads.{name}[{k}]"
            kind, rest = split(table, "kind", LOADS, where)
            loads.append(from_table(LOADS[kind], rest, where))
        found[name] = tuple(loads)
    return found


def read_combinations(
    tables: Mapping[str, Any], cases: Mapping[str, Any]
) -> dict[str, dict[str, float]]:
    """Read the tables ``[combinations.NAME]``, which give load cases their factors.

    Raises
    ------
    InputError
    """
    found = {}
    for name, table in tables.items():
        where = f"combinations.{name}"
        if not isinstance(table, Mapping) or not table:
            raise InputError(
                f"{where} must be a table of load cases with their factors; got {table!r}: write "
                f"[{where}] and NAME = FACTOR"
            )
        for case, factor in table.items():
            if case not in cases:
                raise InputError(
                    f"{where} names no load case '{case}'; there are: {known_names(case, cases)}"
                )
            if isinstance(factor, bool) or not isinstance(factor, int | float):
                raise InputError(f"{where}.{case} must be a number; got {factor!r}: correct it")
            if not np.isfinite(factor):
                raise InputError(f"{where}.{case} must be finite; got {factor!r}: correct it")
        if name in cases:
            raise InputError(f"{where} has the name of a load case: rename one of them")
        found[name] = {case: float(factor) for case, factor in table.items()}
    return found
