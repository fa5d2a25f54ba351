"""The regions of a part file: which cells are of another material."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.toml import from_table
from ccfem.body.mesh.cell_rules import CellBox, CellCylinder, CellRule
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.part_tables import material_of, named_table
from ccfem.fem.elasticity.problem import Region
from ccfem.fem.materials import Material

REGIONS: dict[str, Callable[..., CellRule]] = {"box": CellBox, "cylinder": CellCylinder}
"""Rules that choose cells."""


def region_rules_of(
    tables: Mapping[str, Any], found: Mistakes
) -> dict[str, tuple[Material, CellRule]]:
    """Materials and rules of the tables [regions.NAME]; what is wrong is noted."""
    rules = {}
    for name, table in tables.items():
        with found.noted():
            rules[name] = _region(f"regions.{name}", table)
    return rules


def _region(where: str, table: object) -> tuple[Material, CellRule]:
    """Material of a region, and the rule that chooses its cells."""
    rule, rest = named_table(table, "rule", REGIONS, where)
    if "material" not in rest:
        raise InputError(f"{where} needs the key 'material': a name of the table, or a table")
    material = rest.pop("material")
    if not isinstance(material, str | dict):
        raise InputError(
            f"{where}.material must be a string or a table; got {shown(material)}: name one"
        )
    chooses = from_table(REGIONS[rule], rest, where, infinite=rule == "box")
    return material_of(material, f"{where}.material"), chooses


def regions_of(mesh: TetMesh, rules: Mapping[str, tuple[Material, CellRule]]) -> tuple[Region, ...]:
    """Choose the cells of every region.

    Raises
    ------
    InputError
        For a region without a cell, and for two that share some.
    """
    owner = np.full(len(mesh.cells), -1)
    names, found = list(rules), []
    for k, (name, (material, rule)) in enumerate(rules.items()):
        try:
            cells = rule(mesh)
        except InputError as error:
            raise InputError(f"region '{name}': {error}") from None
        taken = owner[cells]
        if (taken >= 0).any():
            other = names[taken.max()]
            raise InputError(
                f"regions '{other}' and '{name}' share {np.count_nonzero(taken >= 0)} cells: move "
                "their border so that each cell is in one of them"
            )
        owner[cells] = k
        found.append(Region(material, cells))
    return tuple(found)
