"""A case as a part file: what `read_part` reads, written."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import tomlkit

from ccfem.base.checks import member_name
from ccfem.base.errors import InputError, shown
from ccfem.cases.case import Case
from ccfem.cases.part_fibre import fibre_table
from ccfem.cases.part_loads import LOADS, SUPPORTS
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.materials import Material
from ccfem.judging.virtual_testing.scatter import DEFAULT_SCATTER
from ccfem.machine.machine import Machine
from ccfem.paths.plastic.plastic import SOLID
from ccfem.printing.bed_layout import bed_table
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
        "bed": bed_table(case.bed),
        "material": _material(problem.material),
        "slicing": {"method": member_name(case.slicing), **_changed(case.slicing, Planar())},
        "fibre": fibre_table(case.fibre),
        "plastic": _changed(case.plastic, SOLID),
        "scatter": _changed(case.scatter, DEFAULT_SCATTER),
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
    document = tomlkit.document()
    for line in comment.splitlines():
        document.add(tomlkit.comment("".join(c if c.isprintable() else "?" for c in line)))
    if comment:
        document.add(tomlkit.nl())
    document.update(_plain({k: v for k, v in content.items() if v not in ("", [])}))
    text = document.as_string()
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise InputError(
            f"names and texts of a part file must be Unicode; got {shown(text[error.start :])}: "
            "rename what is named so"
        ) from None
    return text


def _plain(value: Any) -> Any:
    """Return a value in types of Python alone, without the tables in it that are empty."""
    if isinstance(value, Mapping):
        kept = {k: v for k, v in value.items() if not isinstance(v, Mapping) or v}
        return {key: _plain(entry) for key, entry in kept.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(entry) for entry in value]
    return value.item() if isinstance(value, np.generic) else value


def _supports(problem: Problem) -> list[dict[str, Any]]:
    """Tables of the supports, those that hold in some load cases alone with their names."""
    tables = [_kind(support, SUPPORTS) for support in problem.supports]
    for support in problem.all_supports[len(problem.supports) :]:
        cases = [name for name, held in problem.case_supports.items() if support in held]
        tables.append({**_kind(support, SUPPORTS), "case": cases})
    return tables


def _kind(value: Any, kinds: Mapping[str, Callable[..., Any]]) -> dict[str, Any]:
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
    """Table of a material with one axis, or none."""
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
    # Moduli come from an inverted stiffness: without rounding, 3500 is 3499.9999999999995.
    return {k: v if isinstance(v, str) else float(f"{v:.12g}") for k, v in table.items()}
