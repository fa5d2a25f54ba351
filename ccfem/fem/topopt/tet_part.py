"""The part that a design of tetrahedra stands for, cut out of its mesh."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.problem import PointForce, Problem
from ccfem.fem.topopt.cut import cut_mesh, volume_above
from ccfem.fem.topopt.cut_smoothing import relaxed
from ccfem.fem.topopt.design import Design
from ccfem.geometry.facets import unique_edges
from ccfem.geometry.measures import connected

_LEAST_VOID = 30.0
"""Enclosed voids below this many cells are filled."""


class _Field(NamedTuple):
    """Density at the nodes of a mesh, and what has to be joined.

    The share (n,) of a node is its part of the volume of the cells round it, in mean cells; pairs
    (e, 2) are joined by an edge; anchors are the nodes of every loaded and held patch, and of
    point forces.
    """

    mesh: TetMesh
    values: FloatArray
    share: FloatArray
    pairs: IntArray
    anchors: list[IntArray]


def part_mesh(
    design: Design, volume_fraction: float | None = None, threshold: float | None = None
) -> TetMesh:
    """Mesh of the part of a design of tetrahedra, with the patches of the whole.

    Parameters
    ----------
    design : Design
        Of tetrahedra.
    volume_fraction : float in (0, 1], optional
        Share of the volume that the part fills; default that of the design.
    threshold : float in (0, 1), optional
        Density at the surface, in place of the share.

    Returns
    -------
    TetMesh
        The piece that joins all loads and supports: cut where the density, averaged at the nodes,
        passes the threshold; small enclosed voids filled; smoothed.

    Raises
    ------
    InputError
        When no piece joins them.
    """
    problem = design.full
    assert isinstance(problem, Problem)
    field = _field(problem, design.density)
    if threshold is None:
        share = design.volume_fraction if volume_fraction is None else volume_fraction
        check_number("volume_fraction", share, above=0.0, at_most=1.0)
        threshold = _level(field, share * float(problem.mesh.volumes.sum()))
        if threshold is None:
            raise InputError(design.apart)
    else:
        check_number("threshold", threshold, above=0.0, below=1.0)
    cleaned = _cleaned(field, threshold)
    if cleaned is None:
        raise InputError(design.apart)
    return relaxed(cut_mesh(problem.mesh, cleaned, threshold))


def _field(problem: Problem, density: FloatArray) -> _Field:
    mesh = problem.mesh
    n, nodes = len(mesh.points), mesh.cells.reshape(-1)
    weight = np.bincount(nodes, np.repeat(mesh.volumes, 4), n)
    total = np.bincount(nodes, np.repeat(mesh.volumes * density, 4), n)
    anchors = [np.unique(mesh.patch(name)) for name in problem.held_or_loaded]
    for load in (load for case in problem.loads.values() for load in case):
        if isinstance(load, PointForce):
            anchors.append(np.array([cKDTree(mesh.points).query(load.point)[1]]))
    return _Field(
        mesh=mesh,
        values=total / np.maximum(weight, 1e-300),
        share=0.25 * weight / mesh.volumes.mean(),
        pairs=unique_edges(mesh.cells[:, mesh.edges].reshape(-1, 2))[0],
        anchors=anchors,
    )


def _pieces(field: _Field, chosen: BoolArray) -> IntArray:
    """Piece (n,) of each chosen node, by edges between chosen nodes; others by themselves."""
    return connected(field.pairs[chosen[field.pairs].all(axis=1)], len(chosen))


def _cleaned(field: _Field, level: float) -> FloatArray | None:
    """Keep the piece above a level that joins all anchors, and fill small voids in it.

    None where no piece joins them.
    """
    values = field.values.copy()
    inside = values > level
    piece = _pieces(field, inside)
    joining = None
    for nodes in field.anchors:
        here = np.unique(piece[nodes[inside[nodes]]])
        joining = here if joining is None else np.intersect1d(joining, here)
    if joining is None or not len(joining):
        return None
    inside &= piece == joining[np.bincount(piece)[joining].argmax()]
    piece = _pieces(field, ~inside)
    enclosed = ~np.isin(piece, piece[np.unique(field.mesh.boundary)])
    small = np.bincount(piece, field.share)[piece] < _LEAST_VOID
    values[~inside] = np.minimum(values[~inside], level)
    values[~inside & enclosed & small] = 1.0
    return values


def _level(field: _Field, volume: float) -> float | None:
    """Level whose part has a wanted volume, by bisection; None where none has."""
    low, high, found, middle = 0.0, 1.0, 0.0, 0.5
    for _ in range(20):
        middle = 0.5 * (low + high)
        cleaned = _cleaned(field, middle)
        found = 0.0 if cleaned is None else volume_above(field.mesh, cleaned, middle)
        if abs(found - volume) <= 1e-3 * volume:
            return middle
        low, high = (middle, high) if found > volume else (low, middle)
    return middle if abs(found - volume) <= 0.02 * volume else None
