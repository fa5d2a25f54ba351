"""What every reader does with cells and groups of facets: tetrahedra of one order, and patches."""

from collections.abc import Iterable, Mapping
from os import PathLike

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import are_among, facet_keys

_SOLIDS = ("tetra", "hexahedron", "wedge", "pyramid", "polyhedron", "voxel")


def tetrahedra(blocks: Iterable[tuple[str, IntArray]], path: str | PathLike[str]) -> IntArray:
    """Join the tetrahedra of a file, (m, 4) or (m, 10).

    Parameters
    ----------
    blocks : iterable of (type, nodes)
        Type in meshio's words, nodes (m, k).
    path : path
        For the messages.

    Raises
    ------
    InputError
        When there are no tetrahedra, when linear and quadratic ones are mixed, or when some of
        the volume is meshed with other cells (dropping them would leave holes).
    """
    nodes_by_kind: dict[str, list[IntArray]] = {}
    for kind, nodes in blocks:
        if len(nodes):
            nodes_by_kind.setdefault(kind, []).append(np.asarray(nodes, dtype=np.int64))
    counts = {kind: sum(map(len, parts)) for kind, parts in nodes_by_kind.items()}
    held = ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items())) or "no cells"
    solids = sorted(kind for kind in nodes_by_kind if kind.startswith(_SOLIDS))
    if solids == ["tetra"] or solids == ["tetra10"]:
        return np.concatenate(nodes_by_kind[solids[0]])
    if set(solids) & {"tetra", "tetra10"}:
        raise InputError(
            f"{path} must be meshed with linear or with quadratic tetrahedra throughout; it has "
            f"{held}: mesh it again with one kind"
        )
    raise InputError(
        f"{path} holds no tetrahedra; it has {held}: mesh the volume with tetrahedra (in Gmsh make "
        "it a Physical Volume, too), or give a closed surface as STL, OBJ or PLY"
    )


def outside(mesh: TetMesh) -> IntArray:
    """Boundary facets (b, 3), outward, of a mesh in which cells may be given twice."""
    _, first = np.unique(facet_keys(mesh.corners)[0], return_index=True)
    if len(first) == len(mesh.cells):
        return mesh.boundary
    return TetMesh(mesh.points, mesh.cells[np.sort(first)]).boundary


def with_groups(mesh: TetMesh, groups: Mapping[str, IntArray]) -> TetMesh:
    """Return the mesh with groups of facets (k, 3) as patches: those on the boundary, or none."""
    border = outside(mesh)
    return mesh.with_patches(
        {name: border[are_among(border, facets)] for name, facets in groups.items()}
    )
