"""Tables of a part file to values: rules of patches, loads, material, parameters of strategies."""

from collections.abc import Callable, Mapping
from typing import Any

from ccfem.elasticity.problem import (
    Bearing,
    Force,
    Load,
    PointForce,
    Pressure,
    Traction,
)
from ccfem.elasticity.support_kinds import AnySupport, PressingSupport, Support
from ccfem.errors import InputError, Mistakes, shown
from ccfem.io.toml import from_table
from ccfem.materials import (
    Material,
    isotropic,
    material_names,
    named_material,
    transversely_isotropic,
)
from ccfem.mesh.face_rules import Faces, Holes
from ccfem.mesh.patches import Box, Cylinder, Group, Nearest, PatchRule, Plane

__all__ = [
    "alternative_supports_of",
    "check_strategies",
    "loads_of",
    "material_of",
    "named_table",
    "rules_of",
    "supports_of",
]

_RULES: dict[str, Callable[..., PatchRule]] = {
    "plane": Plane,
    "box": Box,
    "cylinder": Cylinder,
    "nearest": Nearest,
    "group": Group,
    "face": Faces,
    "holes": Holes,
}
_HELD = "held"
_SUPPORTS: dict[str, Callable[..., AnySupport]] = {_HELD: Support, "pressing": PressingSupport}
_LOADS: dict[str, Callable[..., Load]] = {
    "force": Force,
    "traction": Traction,
    "pressure": Pressure,
    "bearing": Bearing,
    "point": PointForce,
}


def rules_of(tables: Mapping[str, Any], found: Mistakes) -> dict[str, PatchRule]:
    """Rules of the tables [patches.NAME]; what is wrong is noted."""
    rules = {}
    for name, table in tables.items():
        with found.noted():
            where = f"patches.{name}"
            kind, rest = named_table(table, "rule", _RULES, where)
            make = _RULES[kind]
            if kind == "plane" and "point" in rest:
                make = Plane.through
            rules[name] = from_table(make, rest, where, infinite=kind == "box")
    return rules


def supports_of(tables: tuple[dict[str, Any], ...], found: Mistakes) -> tuple[AnySupport, ...]:
    """Supports of the tables [[supports]]; what is wrong is noted."""
    if not tables:
        found.lines.append("a part needs a support: add [[supports]] with its patch")
    return _supports(tables, "supports", found)


def alternative_supports_of(
    tables: tuple[dict[str, Any], ...], found: Mistakes
) -> tuple[AnySupport, ...]:
    """Supports of the tables [[alternative_supports]], if any; what is wrong is noted."""
    return _supports(tables, "alternative_supports", found)


def _supports(
    tables: tuple[dict[str, Any], ...], key: str, found: Mistakes
) -> tuple[AnySupport, ...]:
    supports: list[AnySupport] = []
    for k, table in enumerate(tables):
        with found.noted():
            where = f"{key}[{k}]"
            kind, rest = named_table({"kind": _HELD, **table}, "kind", _SUPPORTS, where)
            supports.append(from_table(_SUPPORTS[kind], rest, where))
    return tuple(supports)


def loads_of(cases: Mapping[str, Any], found: Mistakes) -> dict[str, tuple[Load, ...]]:
    """Read the loads of every load case; what is wrong is noted."""
    if not cases:
        found.lines.append("a part needs a load: add [[loads.NAME]] with its kind")
    loads: dict[str, tuple[Load, ...]] = {}
    for name, tables in cases.items():
        if not isinstance(tables, list) or not tables:
            found.lines.append(
                f"loads.{name} must be a list of tables; got {shown(tables)}: write "
                f"[[loads.{name}]]"
            )
            continue
        for k, table in enumerate(tables):
            with found.noted():
                where = f"loads.{name}[{k}]"
                kind, rest = named_table(table, "kind", _LOADS, where)
                load = from_table(_LOADS[kind], rest, where)
                loads[name] = (*loads.get(name, ()), load)
    return loads


def named_table(
    table: object, key: str, known: Mapping[str, Any], where: str
) -> tuple[str, dict[str, Any]]:
    """Split a table into the name under a key, which must be known, and the rest."""
    name = table.get(key) if isinstance(table, Mapping) else None
    if not isinstance(table, Mapping) or not isinstance(name, str) or name not in known:
        raise InputError(
            f"{where} must be a table with {key} one of {', '.join(known)}; got "
            f"{shown(table if name is None else name)}: correct it"
        )
    return name, {k: value for k, value in table.items() if k != key}


def material_of(given: str | dict[str, Any] | None) -> Material:
    """Material by name, or of its moduli."""
    if given is None:
        raise InputError(
            f"a part needs a material: name one of {', '.join(material_names())}, or give "
            "[material] with modulus and poisson"
        )
    if isinstance(given, str):
        return named_material(given)
    make = transversely_isotropic if "modulus_fibre" in given else isotropic
    return from_table(make, given, "material")


def check_strategies(tables: Mapping[str, Any], found: Mistakes) -> None:
    """Note unknown strategies, and parameters that they do not take."""
    if not tables:
        return
    from ccfem.strategies import create

    for name, parameters in tables.items():
        with found.noted():
            if not isinstance(parameters, Mapping):
                raise InputError(
                    f"strategies.{name} must be a table; got {shown(parameters)}: write "
                    f"[strategies.{name}]"
                )
            create(name, parameters)
