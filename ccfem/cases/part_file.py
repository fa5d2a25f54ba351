"""Part files: a part with its loads, described in TOML.

Lengths are mm, forces N, stresses MPa. Paths are relative to the part file. Nothing in a part file
is executed, and a key that is not listed is an error. Directions are "x", "y", "z", one of them
with a minus ("-z"), or three numbers. All keys stand in ``all_keys.toml`` beside this module, whose
text is `ALL_KEYS`.
"""

import os
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, TypeVar

import numpy as np

from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.toml import TomlTable, from_table, read_toml
from ccfem.body.files.surface import Shell, Surface, refined
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import (
    CellBox,
    CellCylinder,
    CellRule,
    Faces,
    Holes,
    OnBody,
    about_patches,
    numbered_faces,
    without_faces,
)
from ccfem.body.mesh.patches import PatchRule, face_name, patches_from_rules, unit_vector
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, smooth_faces
from ccfem.body.mesh.tet_mesh import CellMesh, TetMesh
from ccfem.body.meshing.cad import is_cad
from ccfem.body.meshing.volume import check_edge_length
from ccfem.cases.case import Case, check_name
from ccfem.cases.deck_analysis import DeckAnalysis, read_analysis
from ccfem.cases.part_fibre import fibre_of, patches_of_fibre
from ccfem.cases.part_keys import Part
from ccfem.cases.part_loads import (
    alternative_supports_of,
    combinations_of,
    loads_of,
    supports_of,
    weights_of,
)
from ccfem.cases.part_tables import check_strategies, material_of, named_table, plastic_of, rules_of
from ccfem.fem.elasticity.load_kinds import Load, SurfaceLoad, patches_in_use, patches_of
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.elasticity.nodes import LoadedBody
from ccfem.fem.elasticity.problem import Problem, Region
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.fem.elasticity.supports import held
from ccfem.fem.materials import Material
from ccfem.judging.virtual_testing.scatter import Scatter
from ccfem.machine.machine import Machine
from ccfem.machine.named_machines import machine_from
from ccfem.paths.placement.fibre_places import FibrePlaces
from ccfem.paths.plastic.plastic import Plastic
from ccfem.printing.bed_layout import BedLayout, bed_of
from ccfem.slicing import slicers as slicers
from ccfem.slicing.layers.slicer import Slicer, Vector
from ccfem.slicing.slicers.planar import Planar

T = TypeVar("T")

ALL_KEYS = Path(__file__).with_name("all_keys.toml").read_text(encoding="utf-8")
"""All keys with what they mean, alternatives one below the other."""


def read_part(path: str | os.PathLike[str]) -> Case:
    """Read a part file (its keys are in the documentation of this module).

    Parameters
    ----------
    path : path
        A TOML file.

    Returns
    -------
    Case
        `Case.findings` says what was repaired in the mesh.

    Raises
    ------
    InputError
        With the name of the file, what was expected, what came and the cure.
    """
    return _of_file(path, part_case)


def deck_part(path: str | os.PathLike[str]) -> Case:
    """Read a deck (.inp) with its analysis as a part by itself: see `read_part`."""
    path = Path(path)
    return _with_name({"mesh": path.name, "analysis": "deck"}, path, part_case)


def faces_of_part(path: str | os.PathLike[str], angle: float = FEATURE_ANGLE) -> BodyFaces:
    """Faces of a part file's body, numbered as its rules have them; only the body is read.

    The feature angle is in degrees.
    """
    return _of_file(path, lambda content, path: faces_of_content(content, path.parent, angle))


def faces_of_content(content: TomlTable, folder: Path, angle: float = FEATURE_ANGLE) -> BodyFaces:
    """Faces of the body of a part file's content, whose paths start from a folder."""
    return _readable(content, Mistakes())[0].faces(folder, angle)


def _of_file(path: str | os.PathLike[str], take: Callable[[TomlTable, Path], T]) -> T:
    """Take something of a part file's content; the file's name is in every mistake."""
    path = Path(path)
    return _with_name(read_toml(path, "part file"), path, take)


def _with_name(content: TomlTable, path: Path, take: Callable[[TomlTable, Path], T]) -> T:
    """Take something of the content of a part; the file's name is in every mistake."""
    try:
        return take(content, path)
    except InputError as error:
        raise InputError(
            *(line if str(path) in line else f"{path}: {line}" for line in error.mistakes)
        ) from None


def part_case(content: TomlTable, path: Path, mesh: TetMesh | None = None) -> Case:
    """Case of a part file's content; all mistakes come at once, if possible before meshing.

    A mesh that is given takes the place of the one that the file names.
    """
    mistakes = Mistakes()
    part, unread = _readable(content, mistakes)
    name = part.name or path.stem
    with mistakes.noted():
        check_name(name, part.title or name)
    given = _values(part, unread, path.parent, mistakes)
    check_strategies(part.strategies, mistakes)
    rules = rules_of(part.patches, mistakes)
    with mistakes.noted():
        part.check(path.parent)
    deck, supports, case_supports, loads = _acting(part, unread, path.parent, mistakes)
    names: TomlTable = part.loads if deck is None else dict(loads)
    others = alternative_supports_of(part.alternative_supports, mistakes)
    combinations = combinations_of(part.combinations, names, mistakes)
    weights = weights_of(part.weights, {**names, **part.combinations}, mistakes)
    regions = region_rules_of(part.regions, mistakes)
    mistakes.complain()

    rules, angle = _on_body(rules, part, path.parent, mistakes)
    mistakes.complain()

    def before(surface: Surface) -> None:
        assert part.edge_length is not None
        check_before_meshing(
            surface, part.edge_length, rules, supports, loads, case_supports, angle
        )

    findings: tuple[str, ...] = ()
    if mesh is None:
        known = None if deck is None else deck.mesh
        mesh, findings = part.read(path.parent, before, angle, known)
    for patch, rule in rules.items():
        with mistakes.noted():
            mesh = patches_from_rules(mesh, {patch: rule})
    mistakes.complain()
    near = patches_of_fibre(given.fibre)
    for patch in near:
        mesh.patch(patch)
    held = (*supports, *others, *chain.from_iterable(case_supports.values()))
    bare = without_faces(mesh, (*rules, *near, *patches_in_use(held, loads)))
    material, cells, axes = (
        (given.material, regions_of(bare, regions), None) if deck is None else deck.on_cells(bare)
    )
    return Case(
        name=name,
        title=part.title or name,
        problem=Problem(
            bare,
            material,
            supports,
            loads,
            axes=axes,
            regions=cells,
            combinations=combinations,
            order=part.order,
            case_supports=case_supports,
        ),
        build=given.build,
        bed=given.bed,
        slicing=given.slicing,
        machine=given.machine,
        parameters=part.strategies,
        source=part.source,
        findings=(*findings, *(deck.remarks if deck else ()), *about_patches(bare, rules)),
        alternative_supports=others,
        fibre=given.fibre,
        plastic=given.plastic,
        scatter=given.scatter,
        weights=weights,
        body=numbered_faces(mesh) if len(bare.patches) < len(mesh.patches) else None,
    )


def _on_body(
    rules: Mapping[str, PatchRule], part: Part, folder: Path, mistakes: Mistakes
) -> tuple[dict[str, PatchRule], float]:
    """Rules for faces looked up on the surface before it is meshed, and its feature angle.

    Numbers of a CAD file are those of its groups: it is read for places alone.
    """
    faces = {name: rule for name, rule in rules.items() if isinstance(rule, Faces)}
    angles = {rule.angle for rule in rules.values() if isinstance(rule, Faces | Holes)}
    angles = angles or {FEATURE_ANGLE}
    if part.surface is None:
        return dict(rules), FEATURE_ANGLE
    if len(angles) > 1:
        raise InputError(
            "rules face and holes of one part need one feature angle; got "
            f"{', '.join(f'{angle:g}' for angle in sorted(angles))} degrees: choose one"
        )
    (angle,) = angles
    if is_cad(part.surface):
        faces = {name: rule for name, rule in faces.items() if rule.at is not None}
    if not faces:
        return dict(rules), angle
    body = part.faces(folder, angle)
    assert part.edge_length is not None
    check_edge_length(Surface(body.points, body.triangles), part.edge_length)
    for name, rule in faces.items():
        with mistakes.noted():
            try:
                rule.numbers_on(body)
            except InputError as error:
                raise InputError(f"patch '{name}': {error}") from None
    return {**rules, **{name: OnBody(rule, body) for name, rule in faces.items()}}, angle


class _Values:
    """What the sections of a part file give; none is missing where there was no mistake."""

    build: Vector
    bed: BedLayout
    slicing: Slicer
    machine: Machine
    material: Material
    plastic: Plastic
    scatter: Scatter
    fibre: FibrePlaces | None = None


def _values(part: Part, unread: Container[str], folder: Path, mistakes: Mistakes) -> _Values:
    """Take what stands in sections of its own."""
    given = _Values()
    with mistakes.noted():
        given.build, given.bed = bed_of(unit_vector(part.build, "build").tolist(), part.bed)
    with mistakes.noted():
        given.slicing = slicing_of(part)
    with mistakes.noted():
        given.machine = machine_from(part.machine)
    if "material" not in unread and part.analysis is None:
        with mistakes.noted():
            given.material = material_of(part.material)
    if part.fibre is not None:
        with mistakes.noted():
            given.fibre = fibre_of(part.fibre, folder)
    with mistakes.noted():
        given.plastic = plastic_of(part.plastic)
    with mistakes.noted():
        given.scatter = from_table(Scatter, part.scatter, "scatter")
    return given


class _Acting(NamedTuple):
    """What holds and loads a part, and the analysis of a deck that says so, if one does."""

    deck: DeckAnalysis | None
    supports: tuple[AnySupport, ...]
    case_supports: dict[str, tuple[AnySupport, ...]]
    loads: dict[str, tuple[Load, ...]]


def _acting(part: Part, unread: Container[str], folder: Path, mistakes: Mistakes) -> _Acting:
    """Take supports and loads, from the part file or from the deck that it names."""
    if part.analysis is None:
        supports, case_supports = (
            ((), {}) if "supports" in unread else supports_of(part.supports, part.loads, mistakes)
        )
        loads = {} if "loads" in unread else loads_of(part.loads, mistakes)
        return _Acting(None, supports, case_supports, loads)
    mistakes.complain()
    assert part.mesh is not None
    deck = read_analysis(folder / part.mesh, part.scale, part.step)
    if part.order == 1 and deck.mesh.order == 2:
        mistakes.lines.append("order = 1 goes with a deck of linear cells: leave it out")
    return _Acting(deck, deck.supports, dict(deck.case_supports), dict(deck.loads))


def _readable(content: TomlTable, mistakes: Mistakes) -> tuple[Part, set[str]]:
    """Take of a part file what reads; the rest is noted, and named."""
    good = {}
    for key, value in content.items():
        with mistakes.noted():
            from_table(Part, {key: value}, "the part file")
            good[key] = value
    return from_table(Part, good, "the part file"), set(content) - set(good)


# The slicer of a part file.


def slicing_of(part: Part) -> Slicer:
    """Slicer of a part file: of its number of layers, their heights, or the table slicing."""
    given = [key for key in ("layers", "heights", "slicing") if getattr(part, key) is not None]
    if len(given) > 1:
        raise InputError(
            f"a part needs one of layers, heights and slicing; got {' and '.join(given)}: choose "
            "one"
        )
    if part.slicing is not None:
        return slicers.create(*named_table(part.slicing, "method", slicers.named(), "slicing"))
    return Planar(count=part.layers, heights=part.heights)


# The regions of a part file: which cells are of another material.


REGIONS: dict[str, Callable[..., CellRule]] = {"box": CellBox, "cylinder": CellCylinder}
"""Rules that choose cells."""


def region_rules_of(tables: TomlTable, mistakes: Mistakes) -> dict[str, tuple[Material, CellRule]]:
    """Materials and rules of the tables [regions.NAME]; what is wrong is noted."""
    rules = {}
    for name, table in tables.items():
        with mistakes.noted():
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
    names, chosen = list(rules), []
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
        chosen.append(Region(material, cells))
    return tuple(chosen)


# What can be known of patches and supports before a surface is meshed, which may take minutes.


@dataclass(frozen=True)
class _Outline:
    """Supports and loads on a surface alone."""

    mesh: CellMesh
    body: LoadedBody
    supports: tuple[AnySupport, ...]
    loads: Mapping[str, tuple[Load, ...]]


def check_before_meshing(
    surface: Surface,
    edge_length: float,
    rules: Mapping[str, PatchRule],
    supports: tuple[AnySupport, ...],
    loads: Mapping[str, tuple[Load, ...]],
    case_supports: Mapping[str, tuple[AnySupport, ...]] = MappingProxyType({}),
    angle: float = FEATURE_ANGLE,
) -> None:
    """Try rules, supports and loads on the surface, cut finer than the mesh will be.

    The feature angle, degrees, is that between the faces of the surface.

    Raises
    ------
    InputError
        For rules that choose nothing, unknown patches, loads that their patch cannot take, and
        motions that no support hinders.
    """
    mistakes = Mistakes()
    points, triangles, origin = refined(surface.points, surface.triangles, 0.5 * edge_length)
    groups = {
        face_name(k): triangles[np.isin(origin, face.facets)]
        for k, face in enumerate(smooth_faces(surface.points, surface.triangles, angle), 1)
    }
    shell = Shell(points, triangles, groups)
    for name, rule in rules.items():
        with mistakes.noted():
            shell = patches_from_rules(shell, {name: rule})
    holding = (*supports, *chain.from_iterable(case_supports.values()))
    for name in set(patches_in_use(holding, loads)) - set(rules):
        with mistakes.noted():
            shell.patch(name)
    mistakes.complain()
    sets = [(*supports, *case_supports.get(name, ())) for name in loads] or [supports]
    for k, together in enumerate(sets):
        if together not in sets[:k]:
            with mistakes.noted():
                held(_Outline(shell, shell, together, loads))
    for load in chain.from_iterable(loads.values()):
        if isinstance(load, SurfaceLoad) and patches_of(load):
            with mistakes.noted():
                nodal_forces(shell, load)
    mistakes.complain()
