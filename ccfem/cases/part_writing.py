"""A case as a part file: what `read_part` reads, written."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ccfem.base.checks import member_name
from ccfem.base.errors import InputError
from ccfem.cases.case import Case
from ccfem.cases.part_fibre import fibre_table
from ccfem.cases.part_loads import LOADS, SUPPORTS
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.materials import Material
from ccfem.machine.machine import Machine
from ccfem.slicing.slicers.planar import Planar


def part_text(case: Case, mesh: str, comment: str = "") -> str:
    """Text of the part file of a case.

    Parameters
    ----------
    case : Case
        Of one material, that lies along no axes of its own.
    mesh : str
        Name of the file that its mesh, with the patches, is written to.
    comment : str
        Lines at its head.

    Raises
    ------
    InputError
        For what a part file cannot say.
    """
    problem = case.problem
    if problem.regions or problem.axes is not None or problem.density is not None:
        raise InputError(
            "the part file of a changed part takes one material without axes: name one material"
        )
    content: dict[str, Any] = {
        "name": case.name,
        "title": case.title,
        "source": case.source,
        "mesh": mesh,
        "order": problem.order,
        "build": case.build,
        "material": _material(problem.material),
        "slicing": {"method": member_name(case.slicing), **_changed(case.slicing, Planar())},
        "fibre": fibre_table(case.fibre),
        "supports": _supports(problem),
        "alternative_supports": [_kind(entry, SUPPORTS) for entry in case.alternative_supports],
        "loads": {
            name: [_kind(entry, LOADS) for entry in loads] for name, loads in problem.loads.items()
        },
        "combinations": {name: dict(entry) for name, entry in problem.combinations.items()},
        "weights": dict(case.weights),
        "machine": _changed(case.machine, Machine()),
        "strategies": {name: dict(entry) for name, entry in case.parameters.items()},
    }
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    return "\n".join([*lines, "", *_table(content, "")]).lstrip("\n") + "\n"


def _supports(problem: Problem) -> list[dict[str, Any]]:
    """Tables of the supports, those that hold in some load cases alone with their names."""
    tables = [_kind(support, SUPPORTS) for support in problem.supports]
    for support in problem.all_supports[len(problem.supports) :]:
        cases = [name for name, held in problem.case_supports.items() if support in held]
        tables.append({**_kind(support, SUPPORTS), "case": cases})
    return tables


def _kind(value: Any, kinds: Mapping[str, Any]) -> dict[str, Any]:
    """Table of a load or a support, its kind first."""
    kind = next(name for name, make in kinds.items() if make is type(value))
    given = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    return {"kind": kind, **{key: entry for key, entry in given.items() if entry is not None}}


def _changed(value: Any, default: Any) -> dict[str, Any]:
    """Fields of a value that differ from a default, tables in tables; all, of another class."""
    changed = {}
    for field in dataclasses.fields(value):
        entry = getattr(value, field.name)
        other = getattr(default, field.name) if type(value) is type(default) else None
        if entry is None or entry == other:
            continue
        changed[field.name] = _changed(entry, other) if dataclasses.is_dataclass(entry) else entry
    return changed


def _material(material: Material) -> dict[str, Any]:
    """Table of a material with one axis, or none.

    Raises
    ------
    InputError
        For any other.
    """
    compliance = np.linalg.inv(material.stiffness)
    (e1, e2, e3), (_, g13, g12) = (
        1.0 / np.diag(compliance)[rows] for rows in ([0, 1, 2], [3, 4, 5])
    )
    nu, nu23 = -compliance[0, 1] * e1, -compliance[1, 2] * e2
    alike = np.allclose([e2, g12], [e3, g13], rtol=1e-9)
    if not alike or not np.isclose(1.0 / compliance[3, 3], e2 / (2.0 * (1.0 + nu23)), rtol=1e-6):
        raise InputError(
            f"material '{material.name}' cannot stand in a part file: give one that is isotropic, "
            "or alike in all directions across its fibre"
        )
    table: dict[str, Any] = {"name": material.name, "source": material.source}
    heat = material.expansion
    if np.allclose([e2, g12, nu23], [e1, e1 / (2.0 * (1.0 + nu)), nu], rtol=1e-9):
        table |= {"modulus": e1, "poisson": nu}
        table |= {} if heat is None else {"expansion": heat[0]}
    else:
        table |= {"modulus_fibre": e1, "modulus_transverse": e2, "poisson_fibre": nu}
        table |= {"shear_fibre": g12, "poisson_transverse": nu23}
        if heat is not None:
            table |= {"expansion_fibre": heat[0], "expansion_transverse": heat[1]}
    rest = ("tensile_strength", "compressive_strength", "mass_density")
    for key in (*rest, "interlayer_tensile", "interlayer_shear"):
        if getattr(material, key) is not None:
            table[key] = getattr(material, key)
    return table


def _table(content: Mapping[str, Any], path: str) -> list[str]:
    """Lines of a table: its values, then the tables in it; empty ones are left out."""
    lines, below = [], []
    for key, value in content.items():
        name = _key(key)
        if isinstance(value, Mapping):
            if value:
                below += [*_headed(value, f"{path}{name}")]
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for entry in value:
                below += ["", f"[[{path}{name}]]", *_table(entry, f"{path}{name}.")]
        elif not (isinstance(value, list | tuple | str) and not len(value)) or path:
            lines.append(f"{name} = {_value(value)}")
    return lines + below


def _headed(value: Mapping[str, Any], path: str) -> list[str]:
    lines = _table(value, f"{path}.")
    return lines if lines and lines[0] == "" else ["", f"[{path}]", *lines]


def _key(key: str) -> str:
    plain = key.replace("_", "").replace("-", "").isalnum() and key.isascii()
    return key if plain else _value(key)


def _value(value: Any) -> str:
    """Write a value as TOML does."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_value(entry) for entry in value)}]"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        text = "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped)
        return f'"{text}"'
    if isinstance(value, int):
        return str(value)
    number = float(value)
    if math.isinf(number):
        return "inf" if number > 0.0 else "-inf"
    return repr(float(f"{number:.12g}"))
