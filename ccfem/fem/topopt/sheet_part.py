"""A flat part as a sheet in plane stress, and the part that a design of it stands for."""

from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import Plane
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing.prisms import extrude
from ccfem.fem.elasticity.load_kinds import Load, patches_in_use, patches_of
from ccfem.fem.elasticity.problem import PointForce, Problem, Support
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.flat_part import FlatPart
from ccfem.fem.topopt.material_axes import sheet
from ccfem.fem.topopt.outline import outline
from ccfem.fem.topopt.sheet_mesh import sheet_mesh
from ccfem.fem.topopt.short_edges import without_short_edges
from ccfem.geometry.symmetry import mirrors_of

_IN_PLANE = np.ix_([0, 1, 5], [0, 1, 5])
_FACES = ("sheet_bottom", "sheet_top")
_SHORTEST = 0.05
"""Shortest edge of the outline, in element sizes."""
_SYMMETRIC = 0.1
"""Mean difference from its mirror image of a design that is meant to be symmetric."""


def plane_stiffness(stiffness: FloatArray) -> FloatArray:
    """Plane stress stiffness (3, 3) of a thin sheet of a solid with stiffness (6, 6), MPa."""
    return np.asarray(np.linalg.inv(np.linalg.inv(stiffness)[_IN_PLANE]))


def sheet_problem(
    problem: Problem, flat: FlatPart, edge_length: float, stiffness: FloatArray
) -> tuple[Problem, IntArray]:
    """One layer of tetrahedra, held along z everywhere, with the supports and loads of a part.

    Parameters
    ----------
    problem : Problem
    flat : FlatPart
        Of its mesh.
    edge_length : float, mm
    stiffness : (3, 3) array, MPa
        Of the sheet.

    Returns
    -------
    sheet : Problem
        In plane stress.
    prism : (m,) int array
        Cells that are to share their density.

    Raises
    ------
    InputError
        For loads across the plane.
    """
    for name, loads in problem.loads.items():
        for load in loads:
            across = getattr(load, "vector", getattr(load, "acceleration", (0.0, 0.0, 0.0)))[2]
            faces = [flat.traces[patch].faces for patch in patches_of(load)]
            pressed = hasattr(load, "magnitude") and any(
                not f.is_empty for two in faces for f in two
            )
            if across != 0.0 or pressed:
                raise InputError(
                    f"load case '{name}' bends the plate across its plane: a sheet in plane stress "
                    "takes loads along x and y: optimise it in space (--method simp --in-space)"
                )
    mesh, prism = sheet_mesh(flat.planform, flat.low, flat.high, edge_length, flat.ends())
    patches = flat.patches(mesh)
    patches |= {
        name: Plane("z", side, 1e-6)(mesh)
        for name, side in zip(_FACES, ("min", "max"), strict=True)
    }
    broad = np.broadcast_to(sheet(stiffness), (len(mesh.cells), 6, 6))
    supports = tuple(each for each in problem.supports if not _only_across(each, flat))
    return (
        replace(
            problem,
            mesh=mesh.with_patches(patches),
            supports=(*supports, *(Support(name, "z") for name in _FACES)),
            axes=None,
            density=None,
            stiffness=broad,
            regions=(),
            combinations={},
            order=1,
        ),
        prism,
    )


def _only_across(support: AnySupport, flat: FlatPart) -> bool:
    """Whether a support holds the part along z alone, as a table does that it lies on."""
    if isinstance(support, Support) and set(support.components) == {"z"}:
        return True
    names = patches_of(support)
    return bool(names) and all(
        flat.traces[name].wall.is_empty
        and type(support).__name__ in ("PressingSupport", "SlidingSupport")
        for name in names
    )


def sheet_outline(design: Design, flat: FlatPart, edge_length: float, solid: Any, void: Any) -> Any:
    """Outline of the part that a design of a sheet stands for: a shapely Polygon, mm.

    Parameters
    ----------
    design : Design
        Of a problem of `sheet_problem`.
    flat : FlatPart
    edge_length : float, mm
        Of its mesh.
    solid, void : shapely geometries, mm
        Areas that stay full, and empty, exactly.

    Raises
    ------
    InputError
        When no piece joins all loads and supports.
    """
    problem = design.full
    assert isinstance(problem, Problem)
    mesh, dense = problem.mesh, _at_nodes(design)
    left, bottom, right, top = flat.planform.bounds
    count = np.ceil((np.array([right - left, top - bottom]) / edge_length) - 1e-9).astype(int)
    origin = 0.5 * (np.array([left + right, bottom + top]) - count * edge_length)
    rows, columns = np.mgrid[: count[1], : count[0]]
    x = origin[0] + (columns + 0.5) * edge_length
    y = origin[1] + (count[1] - rows - 0.5) * edge_length
    inside = np.asarray(shapely.dwithin(shapely.points(x, y), flat.planform, 0.5 * edge_length))
    plane = mesh.points[:, :2]
    image = LinearNDInterpolator(plane[: len(plane) // 2], dense[: len(plane) // 2])(x, y)
    nearest = NearestNDInterpolator(plane, dense)(x, y)
    image = np.where(np.isfinite(image), image, nearest).clip(0.0, 1.0)
    for axis in mirrors_of(flat.planform):
        other = image[:, ::-1] if axis == 0 else image[::-1]
        if np.abs(image - other)[inside].mean() <= _SYMMETRIC:
            image = 0.5 * (image + other)
    domain = shapely.difference(flat.planform, void)
    shift = shapely.transform(domain, lambda points: points - origin)
    keep = [node for own in _anchors(problem) for node in own[[dense[own].argmax()]]]
    found = outline(
        np.where(inside, image, 0.0),
        edge_length,
        design.volume_fraction,
        domain=shift,
        inside=inside,
        keep=plane[keep] - origin,
        apart=design.apart,
    )
    found = shapely.transform(found, lambda points: points + origin)
    if not shapely.is_empty(solid):
        found = _with_solid(found, shapely.intersection(solid, domain), domain, edge_length)
    ends = flat.ends()
    return without_short_edges(found, flat.planform, ends, _SHORTEST * edge_length)


def _with_solid(found: Any, solid: Any, domain: Any, edge_length: float) -> Any:
    """Outline with areas that stay full, joined to it by rounded corners."""
    round_ = 0.5 * edge_length
    joined = shapely.union(found, solid)
    joined = shapely.intersection(joined.buffer(round_).buffer(-round_), domain)
    pieces = shapely.get_parts(shapely.union(joined, solid))
    return max(pieces, key=lambda piece: piece.area)


def _at_nodes(design: Design) -> FloatArray:
    """Density (n,) at the nodes: mean over the cells round each, by volume."""
    mesh = design.full.mesh
    volume, nodes = design.volumes, mesh.cells.reshape(-1)
    total = np.bincount(nodes, np.repeat(volume * design.density, 4), len(mesh.points))
    both = total + np.roll(total, len(total) // 2)
    weight = np.bincount(nodes, np.repeat(volume, 4), len(mesh.points))
    return np.asarray(both / (weight + np.roll(weight, len(weight) // 2)))


def _anchors(problem: Problem) -> list[IntArray]:
    """Nodes of every loaded and held patch, and at the points of point forces."""
    mesh = problem.mesh
    used = set(patches_in_use(problem.supports, problem.loads)) - set(_FACES)
    found = [np.unique(mesh.patch(name)) for name in sorted(used)]
    for load in (load for case in problem.loads.values() for load in case):
        if isinstance(load, PointForce):
            away = np.linalg.norm(mesh.points - np.array(load.point), axis=1)
            found.append(np.array([away.argmin()]))
    return found


def sheet_part(problem: Problem, flat: FlatPart, planform: Any, edge_length: float) -> Problem:
    """Part of another planform within that of a flat part, held and loaded as that one.

    Raises
    ------
    InputError
        When a patch that is held or loaded is gone.
    """
    mesh = extrude(planform, flat.high - flat.low, edge_length, keep=flat.ends())
    mesh = TetMesh(mesh.points + np.array([0.0, 0.0, flat.low]), mesh.cells)
    patches = flat.patches(mesh)
    loads: dict[str, tuple[Load, ...]] = dict(problem.loads)
    for name in patches_in_use(problem.supports, loads):
        if name not in patches:
            raise InputError(
                f"nothing of patch '{name}' is left in the design: keep it solid (--keep {name}), "
                "or raise the volume fraction"
            )
    return replace(problem, mesh=mesh.with_patches(patches), axes=None, stiffness=None)
