"""Abaqus and CalculiX input decks (``.inp``): solids, and sets and surfaces as patches.

How a deck is read is in `ccfem.body.files.deck`. Patches come from surfaces (of element faces, of
whole elements, or of nodes), from sets of triangles (shells, membranes), and from node sets: a
boundary facet belongs to a node set when its three corners do. Sets whose name begins with an
underscore are the pre-processor's own and give no patch. Names that are the same in another scope,
or for another kind of set, are kept apart: see `_named`.
"""

import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, IntArray
from ccfem.base.errors import InputError, shown
from ccfem.body.files.cells import SplitCells, outside, tetrahedra
from ccfem.body.files.deck import (
    ELEMENTS,
    FACES,
    NODES,
    Members,
    Model,
    chosen_rows,
    element_faces,
    read_deck,
)
from ccfem.body.mesh import TetMesh
from ccfem.geometry.facets import are_among


def read(path: Path) -> TetMesh:
    """Read an Abaqus or CalculiX input deck."""
    try:
        model = read_deck(path)[0]
        return mesh_of(model, tetrahedra(model.points, model.blocks, path), path)
    except InputError as error:
        raise InputError(str(error) if str(path) in str(error) else f"{path}: {error}") from None


def mesh_of(model: Model, cells: SplitCells, path: Path) -> TetMesh:
    """Tetrahedra of a deck with its sets and surfaces as patches; the file is for messages."""
    mesh = cells.mesh(path)
    return mesh.with_patches(_patches(model, mesh, path))


class _Set(NamedTuple):
    """A set or surface with the boundary facets (k, 3) that it chooses."""

    scope: str
    kind: str
    title: str
    facets: IntArray


def _patches(model: Model, mesh: TetMesh, path: Path) -> dict[str, IntArray]:
    """Facets (k, 3) of every surface, node set and set of triangles, which may be none."""
    border, sets = outside(mesh), []
    for scope, content in model.scopes.items():
        for (kind, key), members in content.sets.items():
            title = content.titles[key]
            if kind != FACES and title.startswith("_"):
                continue
            if kind == NODES:
                chosen = _of_nodes(model, scope, members, border)
            elif kind == FACES:
                chosen = _of_surface(model, scope, members, border)
            else:
                rows = chosen_rows(model, scope, ELEMENTS, members)
                if not model.flat[rows].any():
                    continue
                chosen = are_among(border, element_faces(model, rows, "SPOS"))
            sets.append(_Set(content.title, kind, title, border[chosen]))
    return _named(sets, path)


def _of_nodes(model: Model, scope: str, members: list[Members], border: IntArray) -> BoolArray:
    """Whether the corners of each boundary facet are in a node set."""
    inside = np.zeros(len(model.points), dtype=bool)
    inside[chosen_rows(model, scope, NODES, members)] = True
    return np.asarray(inside[border].all(axis=1))


def facets_of_surface(model: Model, name: str, border: IntArray) -> IntArray:
    """Facets (k, 3) of a surface by its name, of nodes those of the outside."""
    scope, _, tail = name.upper().rpartition(".")
    for key, title in ((scope, tail), ("", name.upper())):
        content = model.scopes.get(key)
        if content is not None and (FACES, title) in content.sets:
            members = content.sets[FACES, title]
            of_nodes = _of_nodes(model, key, [m for m in members if m.kind == NODES], border)
            return np.concatenate([_of_elements(model, key, members, border), border[of_nodes]])
    raise InputError(f"the deck has no surface {shown(name)}: name one of its surfaces")


def _of_elements(model: Model, scope: str, members: list[Members], border: IntArray) -> IntArray:
    """Facets (k, 3) of a surface of element faces: named ones, and those of elements outside."""
    facets = [np.zeros((0, 3), dtype=np.int64)]
    for part in members:
        if part.kind == ELEMENTS:
            rows = chosen_rows(model, scope, ELEMENTS, [part])
            faces = element_faces(model, rows, part.face)
            facets.append(faces if part.face else faces[are_among(faces, border)])
    return np.concatenate(facets)


def _of_surface(model: Model, scope: str, members: list[Members], border: IntArray) -> BoolArray:
    """Whether each boundary facet is in a surface."""
    chosen = _of_nodes(model, scope, [part for part in members if part.kind == NODES], border)
    for part in members:
        if part.kind == ELEMENTS:
            rows = chosen_rows(model, scope, ELEMENTS, [part])
            chosen |= are_among(border, element_faces(model, rows, part.face))
    return chosen


def _named(sets: list[_Set], path: Path) -> dict[str, IntArray]:
    """Patches by names that tell different sets apart.

    A set has its name in the deck. Where another scope has a different set of that name, a set of
    an instance is called as Abaqus does, ``P-1.Set-1``. Where a surface, a set of triangles and a
    node set of one scope differ, the later ones have their kind behind the name, with a warning.
    """
    rank = (FACES, ELEMENTS, NODES).index
    by_title: dict[str, list[_Set]] = {}
    for entry in sets:
        by_title.setdefault(entry.title.upper(), []).append(entry)
    patches: dict[str, IntArray] = {}
    for scope, kind, title, facets in sets:
        rivals = [
            other
            for other in by_title[title.upper()]
            if len(other.facets) and not np.array_equal(other.facets, facets)
        ]
        name = title
        if scope and any(other.scope != scope for other in rivals):
            name = f"{scope}.{title}"
        before = [r.kind for r in rivals if r.scope == scope and rank(r.kind) < rank(kind)]
        if before:
            name = f"{name} ({kind})"
        if before and len(facets):
            warnings.warn(
                f"{path}: the {kind} '{title}' differs from the {before[0]} of that name: it is "
                f"patch '{name}'",
                stacklevel=2,
            )
        known = patches.setdefault(name, facets)
        if len(facets) and not np.array_equal(known, facets):
            if len(known):
                raise InputError(f"two different sets have the name {shown(name)}: rename one")
            patches[name] = facets
    return patches
