"""Tables of a part file to values: rules of patches, material, plastic, strategies."""

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.toml import TomlTable, from_table
from ccfem.body.mesh.face_rules import Faces, Holes
from ccfem.body.mesh.patches import Box, Cylinder, Group, Nearest, PatchRule, Plane
from ccfem.fem.materials import (
    Material,
    isotropic,
    material_names,
    named_material,
    transversely_isotropic,
)
from ccfem.paths.plastic.plastic import SOLID, Plastic

RULES: dict[str, Callable[..., PatchRule]] = {
    "plane": Plane,
    "box": Box,
    "cylinder": Cylinder,
    "nearest": Nearest,
    "group": Group,
    "face": Faces,
    "holes": Holes,
}
"""Rules of patches by their name."""


def rules_of(tables: TomlTable, mistakes: Mistakes) -> dict[str, PatchRule]:
    """Rules of the tables [patches.NAME]; what is wrong is noted."""
    rules = {}
    for name, table in tables.items():
        with mistakes.noted():
            where = f"patches.{name}"
            kind, rest = named_table(table, "rule", RULES, where)
            make = RULES[kind]
            if kind == "plane" and "point" in rest:
                make = Plane.through
            rules[name] = from_table(make, rest, where, infinite=kind == "box")
    return rules


def named_table(
    table: object, key: str, known: TomlTable, where: str
) -> tuple[str, dict[str, Any]]:
    """Split a table into the name under a key, which must be known, and the rest."""
    name = table.get(key) if isinstance(table, Mapping) else None
    if not isinstance(table, Mapping) or not isinstance(name, str) or name not in known:
        raise InputError(
            f"{where} must be a table with {key} one of {', '.join(known)}; got "
            f"{shown(table if name is None else name)}: name one"
        )
    return name, {k: value for k, value in table.items() if k != key}


def material_of(given: str | dict[str, Any] | None, where: str = "material") -> Material:
    """Material by name, or of its moduli."""
    if given is None:
        raise InputError(
            f"a part needs a material: name one of {', '.join(material_names())}, or give "
            "[material] with modulus and poisson"
        )
    if isinstance(given, str):
        return named_material(given)
    make = transversely_isotropic if "modulus_fibre" in given else isotropic
    return from_table(make, given, where)


def plastic_of(table: object, base: Plastic = SOLID) -> Plastic:
    """Read a table [plastic]; what it does not name stays as in `base`."""
    if not isinstance(table, Mapping):
        raise InputError(
            f"plastic must be a table; got {shown(table)}: write [plastic] and its keys"
        )
    kept = {field.name: getattr(base, field.name) for field in fields(base)}
    return from_table(Plastic, {**kept, **table}, "plastic")


def check_strategies(tables: TomlTable, mistakes: Mistakes) -> None:
    """Note unknown strategies, and parameters that they do not take."""
    if not tables:
        return
    from ccfem.strategies import create

    for name, parameters in tables.items():
        with mistakes.noted():
            if not isinstance(parameters, Mapping):
                raise InputError(
                    f"strategies.{name} must be a table; got {shown(parameters)}: write "
                    f"[strategies.{name}]"
                )
            create(name, parameters)
