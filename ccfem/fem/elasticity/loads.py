"""Nodal forces of loads, consistent with linear and quadratic facets."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import QhullError, cKDTree

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.base.formula import formula_values
from ccfem.base.tensor import strain_to_voigt
from ccfem.body.mesh import TetMesh, curved_cells
from ccfem.fem.elasticity import load_kinds
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.nodes import (
    FACET_PRODUCTS,
    LoadedBody,
    SupportedProblem,
    facet_normals,
    nearest_node,
    nearest_nodes,
    patch_facets,
)
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.recovery import times
from ccfem.geometry.facets import positions, signed_volumes

_SMALLEST, _LARGEST = 1e-12, 1e12
"""Magnitude of a load below which it is zero, and above which it is a mistake."""
_ALONG = 1e-3
"""Share of a bearing force along the axis of its wall that is taken for the error of that axis."""


def _outward(mesh: LoadedBody, name: str) -> tuple[IntArray, FloatArray, FloatArray]:
    """Facets of a patch with their areas and outward unit normals."""
    facets = patch_facets(mesh, name)
    at = positions(facets, mesh.boundary)
    if (at < 0).any():
        raise InputError(
            f"patch '{name}' has facets inside the part: pressure and bearing need boundary facets"
        )
    facets = mesh.boundary[at]
    return facets, *mesh.facet_areas(facets)


@dataclass(frozen=True)
class _Curved:
    """Quadratic facets with a side on a round wall: their rows, nodes and integrals."""

    rows: IntArray
    nodes: IntArray
    area: FloatArray
    vector: FloatArray

    @classmethod
    def among(cls, mesh: LoadedBody, facets: IntArray) -> "_Curved":
        nodes = mesh.facet_nodes(facets)
        if nodes.shape[1] != 6:
            none = np.zeros(0, dtype=np.int64)
            return cls(none, none.reshape(0, 6), np.zeros((0, 6)), np.zeros((0, 6, 3)))
        corners, middles = mesh.points[nodes[:, :3]], mesh.points[nodes[:, 3:]]
        after = np.roll(corners, -1, axis=1)
        gap = np.linalg.norm(middles - 0.5 * (corners + after), axis=2)
        off = gap > curved_cells.STRAIGHT * np.linalg.norm(after - corners, axis=2)
        rows = np.flatnonzero(off.any(axis=1))
        return cls(rows, nodes[rows], *curved_cells.facet_integrals(mesh.points[nodes[rows]]))

    def true_areas(self, area: FloatArray) -> FloatArray:
        """Areas (k,), mm^2, of all facets, of those of their corners."""
        area[self.rows] = self.area.sum(axis=1)
        return area

    def replaced(self, result: FloatArray, forces: FloatArray, exact: FloatArray) -> FloatArray:
        """Nodal forces with the exact ones (c, 6, 3) of these facets for those spread evenly."""
        if not len(self.rows):
            return result
        for column in self.nodes.T[3:]:
            np.subtract.at(result, column, forces[self.rows] / 3.0)
        np.add.at(result, self.nodes, exact)
        return result


def _consistent_forces(mesh: LoadedBody, facets: IntArray, forces: FloatArray) -> FloatArray:
    """Nodal forces (n, 3) of forces (k, 3) spread evenly over facets; (n, 2) of (k, 2) on a sheet.

    A linear facet gives a third to each corner; a quadratic one a third to each middle; an edge
    of a sheet a half to each end.
    """
    nodes = mesh.facet_nodes(facets)[:, -3:]
    share = nodes.shape[1]
    result: FloatArray = np.zeros(mesh.points.shape)
    for k in range(mesh.points.shape[1]):
        weights = np.repeat(forces[:, k] / share, share)
        result[:, k] = np.bincount(nodes.reshape(-1), weights, len(mesh.points))
    return result


def _load_vector(
    mesh: LoadedBody,
    load: load_kinds.Force | load_kinds.Traction | load_kinds.Bearing | load_kinds.PointForce,
) -> FloatArray:
    """Components of a load in the space of the mesh; PlaneProblem refuses one out of its plane."""
    return np.array(load.vector, dtype=np.float64)[: mesh.points.shape[1]]


def _force(mesh: LoadedBody, load: load_kinds.Force) -> FloatArray:
    facets = patch_facets(mesh, load.patch)
    curved = _Curved.among(mesh, facets)
    area = curved.true_areas(mesh.facet_areas(facets)[0])
    forces, vector = area[:, None] / area.sum() * _load_vector(mesh, load), _load_vector(mesh, load)
    exact = curved.area[:, :, None] / area.sum() * vector
    return curved.replaced(_consistent_forces(mesh, facets, forces), forces, exact)


def _traction(mesh: LoadedBody, load: load_kinds.Traction) -> FloatArray:
    facets = patch_facets(mesh, load.patch)
    curved = _Curved.among(mesh, facets)
    forces = mesh.facet_areas(facets)[0][:, None] * _load_vector(mesh, load)
    exact = curved.area[:, :, None] * _load_vector(mesh, load)
    return curved.replaced(_consistent_forces(mesh, facets, forces), forces, exact)


def _pressure(mesh: LoadedBody, load: load_kinds.Pressure) -> FloatArray:
    facets, area, normal = _outward(mesh, load.patch)
    curved = _Curved.among(mesh, facets)
    forces = -load.magnitude * area[:, None] * normal
    return curved.replaced(
        _consistent_forces(mesh, facets, forces), forces, -load.magnitude * curved.vector
    )


def _bearing(mesh: LoadedBody, load: load_kinds.Bearing) -> FloatArray:
    """Pressure ``-normal . a`` where that is positive, with a fitted to the total force.

    On an evenly meshed half cylinder a is parallel to the force, and the pressure is a cosine. On a
    round wall it acts through the axis: a pin without friction passes no moment about it.
    """
    facets, area, normal = _outward(mesh, load.patch)
    if mesh.points.shape[1] == 3:
        # Where the resultant of what a facet gives to its nodes acts.
        places = mesh.points[mesh.facet_nodes(facets)[:, -3:]].mean(axis=1)
        normal = facet_normals(mesh, facets, places[:, None])[:, 0]
    force = _load_vector(mesh, load)
    touched = normal @ force < 0.0
    for _ in range(50):
        weighted = (area * touched)[:, None] * normal
        a = np.asarray(np.linalg.lstsq(weighted.T @ normal, force, rcond=1e-9)[0])
        now = -(normal @ a) > 1e-9 * np.linalg.norm(a)
        if np.array_equal(now, touched):
            break
        touched = now
    forces = weighted * (normal @ a)[:, None]
    rest = force - forces.sum(axis=0)
    if not np.linalg.norm(rest) <= _ALONG * np.linalg.norm(force):
        raise InputError(
            f"bearing load {load.vector} cannot press on patch '{load.patch}': give a force "
            "across the axis of the hole, toward the wall that the patch covers"
        )
    # The axis of a wall is that of its nodes, which is off by rounding or by chords.
    return _consistent_forces(mesh, facets, forces + area[:, None] / area.sum() * rest)


def _moment(mesh: LoadedBody, load: load_kinds.Moment) -> FloatArray:
    """Tractions ``a x (x - centroid)``, with a such that the nodal forces have the moment.

    The forces are consistent: those of a linear traction on straight facets are exact.
    """
    facets = patch_facets(mesh, load.patch)
    if mesh.points.shape[1] != 3:
        raise InputError(f"a moment goes with a part in space; got patch '{load.patch}' of a sheet")
    nodes = mesh.facet_nodes(facets)
    products = mesh.facet_areas(facets)[0][:, None, None] * FACET_PRODUCTS[nodes.shape[1]]
    weight = products.sum(axis=2)
    centroid = np.einsum("kn,kni->i", weight, mesh.points[nodes]) / weight.sum()
    arm = mesh.points[nodes] - centroid
    second = np.einsum("knm,kni,kmj->ij", products, arm, arm)
    turn = np.linalg.solve(np.trace(second) * np.eye(3) - second, np.asarray(load.vector))
    result = np.zeros(mesh.points.shape)
    np.add.at(result, nodes, products @ np.cross(turn, arm))
    return result


def _point(mesh: LoadedBody, load: load_kinds.PointForce) -> FloatArray:
    result = np.zeros(mesh.points.shape)
    result[nearest_node(mesh, load.point, "a point force")] = _load_vector(mesh, load)
    return result


def _nodes(mesh: LoadedBody, load: load_kinds.NodeForces) -> FloatArray:
    result = np.zeros(mesh.points.shape)
    vectors = np.asarray(load.vectors)[:, : mesh.points.shape[1]]
    np.add.at(result, nearest_nodes(mesh, load.points, "a force"), vectors)
    return result


_KINDS: dict[type, Callable[..., FloatArray]] = {
    load_kinds.Force: _force,
    load_kinds.Traction: _traction,
    load_kinds.Pressure: _pressure,
    load_kinds.Bearing: _bearing,
    load_kinds.Moment: _moment,
    load_kinds.PointForce: _point,
    load_kinds.NodeForces: _nodes,
}


def check_load(load: load_kinds.Load) -> None:
    """Refuse a load that is not finite, absurdly large, or zero; displacements may be zero."""
    for value in vars(load).values():
        if value is None or isinstance(value, str) or value == ():
            continue
        if not np.isfinite(value).all():
            raise InputError(f"a load must be finite; got {load}: correct its numbers")
        if np.max(np.abs(value)) > _LARGEST:
            raise InputError(
                f"numbers of a load must be at most {_LARGEST:g} (N, MPa, mm); got {load}: correct "
                "its numbers"
            )
    sizes = ("vector", "vectors", "magnitude", "acceleration", "speed", "change")
    size = next(getattr(load, name) for name in sizes if hasattr(load, name))
    may_be_none = isinstance(load, load_kinds.Displacement) or isinstance(size, str)
    if not may_be_none and np.max(np.abs(size)) < _SMALLEST:
        raise InputError(f"a load must not be zero; got {load}: give it a size or leave it out")
    for what, value, bounds in load_kinds.sizes_of(load):
        bounds.check(what, value)


def nodal_forces(mesh: LoadedBody, load: load_kinds.SurfaceLoad) -> FloatArray:
    """Return the forces at the nodes that do the same work as a load on the surface.

    Returns
    -------
    (n, 3) array, or (n, 2) on a sheet, N

    Raises
    ------
    InputError
        For a load that is zero or not finite, on an empty or unknown patch, a point force outside
        the part, or a bearing load that no pressure on its patch can carry.
    """
    check_load(load)
    return _KINDS[type(load)](mesh, load)


def load_case(problem: SupportedProblem, name: str) -> FloatArray:
    """Nodal forces (n, 3), or (n, 2) in the plane, N, of one load case of a problem.

    Raises
    ------
    InputError
        For a bad load, or when the loads cancel at every node and no support moves.
    """
    loads = problem.loads[name]
    parts = []
    for load in loads:
        check_load(load)
        if isinstance(load, load_kinds.SurfaceLoad):
            parts.append(nodal_forces(problem.body, load))
        elif isinstance(load, load_kinds.VolumeLoad):
            assert isinstance(problem, Problem)
            parts.append(volume_forces(problem, load))
    heat = any(isinstance(load, load_kinds.Temperature) for load in loads)
    if heat:
        assert isinstance(problem, Problem)
        parts.append(heat_forces(problem, name))
    total: FloatArray = sum(parts, np.zeros(problem.body.points.shape))
    largest = max((float(np.abs(part).max()) for part in parts), default=0.0)
    moved: list[Any] = [load.vector for load in loads if isinstance(load, load_kinds.Displacement)]
    moved += [getattr(support, "value", 0.0) for support in problem.supports]
    moved += [getattr(support, "angle", 0.0) for support in problem.supports]
    still = not heat and not any(np.any(value) for value in moved)
    if still and np.abs(total).max() <= 1e-12 * largest:
        raise InputError(
            f"load case '{name}' is zero and no support moves: nothing to solve for; give a load"
        )
    return total


def load_cases(problem: SupportedProblem) -> dict[str, FloatArray]:
    """Nodal forces of every load case of a problem: see `load_case`."""
    if not problem.loads:
        raise InputError("the part has no load case: give at least one load")
    return {name: load_case(problem, name) for name in problem.loads}


# Loads in the volume of a part: body forces, weight, and heat.


_CORNERS = 4
"""Number of points up to which nothing is between them that the nearest would not tell."""
_AT_POINT = 1e-9
"""Distance of a node from a point, over the reach of all points, that counts as none."""
_TONNES = 1e-9
"""Tonnes per mm^3 in a gram per cm^3; a tonne times a mm/s^2 is a newton."""


def volume_forces(problem: Problem, load: load_kinds.VolumeLoad) -> FloatArray:
    """Find the forces at the nodes (n, 3), N, that do the same work as a load in the volume.

    Raises
    ------
    InputError
        For a weight where a material has no mass density and none is given.
    """
    mesh = problem.mesh
    if isinstance(load, load_kinds.Centrifugal):
        return _centrifugal_forces(problem, load)
    if isinstance(load, load_kinds.BodyForce):
        force = np.tile(np.asarray(load.vector, dtype=np.float64), (len(mesh.cells), 1))
    else:
        density = _mass_density(problem, load)
        force = density[:, None] * (_TONNES * 1e3 * np.asarray(load.acceleration))
    shares = np.full(4, 0.25) if mesh.order == 1 else np.array([-0.05] * 4 + [0.2] * 6)
    volumes = mesh.volumes[:, None] * shares
    if len(mesh.curved):
        volumes[mesh.curved] = curved_cells.integrals(mesh.points[mesh.cells[mesh.curved]])
    return _summed(mesh, force[:, None] * volumes[:, :, None])


def _summed(mesh: TetMesh, forces: FloatArray) -> FloatArray:
    """Sum (n, 3) of the forces (m, q, 3) at the nodes of each cell."""
    result = np.zeros(mesh.points.shape)
    for k in range(3):
        weights = forces[..., k].reshape(-1)
        result[:, k] = np.bincount(mesh.cells.reshape(-1), weights, len(result))
    return result


def _centrifugal_forces(problem: Problem, load: load_kinds.Centrifugal) -> FloatArray:
    """``int N rho speed^2 r dV`` with the radius r from the axis, by quadrature in each cell."""
    mesh = problem.mesh
    axis = np.asarray(load.axis) / np.linalg.norm(load.axis)
    arm = mesh.points - np.asarray(load.point)
    radius = (arm - np.outer(arm @ axis, axis))[mesh.cells]
    size = _TONNES * _mass_density(problem, load) * load.speed**2
    forces = np.zeros(radius.shape)
    for weight, at in zip(curved_cells.CELL_WEIGHTS, curved_cells.CELL_POINTS, strict=True):
        values = at if mesh.order == 1 else curved_cells.shape_values(at)
        volume = np.array(mesh.volumes)
        if len(mesh.curved):
            volume[mesh.curved] = (
                curved_cells.jacobians(mesh.points[mesh.cells[mesh.curved]], at) / 6.0
            )
        here = (weight * size * volume)[:, None] * np.einsum("a,mai->mi", values, radius)
        forces += values[:, None] * here[:, None]
    return _summed(mesh, forces)


def _mass_density(
    problem: Problem, load: load_kinds.Gravity | load_kinds.Centrifugal
) -> FloatArray:
    """Mass density (m,), g/cm^3; density and fill of a cell, where the part has them, scale it."""
    factor = np.ones(len(problem.mesh.cells)) if problem.density is None else problem.density
    factor = factor if problem.fill is None else factor * problem.fill
    if load.mass_density is not None:
        return factor * load.mass_density
    result = np.empty(len(factor))
    for material, cells in problem.materials:
        if material.mass_density is None:
            what = "gravity" if isinstance(load, load_kinds.Gravity) else "a centrifugal load"
            raise InputError(
                f"{what} needs the mass density of material '{material.name}', g/cm^3, which has "
                "none: give mass_density to the load or to the material"
            )
        result[cells] = material.mass_density
    return factor * result


def temperature_change(mesh: TetMesh, load: load_kinds.Temperature) -> FloatArray:
    """Change of temperature (n,), K, at the nodes of a mesh."""
    if isinstance(load.change, str):
        return formula_values(load.change, mesh.points)
    if not isinstance(load.change, tuple):
        return np.full(len(mesh.points), load.change)
    points, change = np.asarray(load.points), np.asarray(load.change)
    away, at = cKDTree(points).query(mesh.points)
    result = change[at]
    between = away > _AT_POINT * max(float(np.ptp(points, axis=0).max()), 1e-300)
    if mesh.order == 2:  # points at the corners of the cells: linear along their sides
        ends, middles = mesh.cells[:, mesh.edges], mesh.cells[:, 4:]
        along = between[middles] & ~between[ends].any(axis=2)
        result[middles[along]] = result[ends[along]].mean(axis=1)
        between[middles[along]] = False
    if between.any() and len(points) > _CORNERS:
        try:
            inside = LinearNDInterpolator(points, change)(mesh.points[between])
            result[between] = np.where(np.isnan(inside), result[between], inside)
        except QhullError:  # points in one plane span no volume to be linear in
            pass
    return result


_PRODUCTS = (np.ones((4, 4)) + np.eye(4)) / 20.0
"""Integrals of the products of two barycentric coordinates over a cell of unit volume."""
_MOMENTS = np.concatenate(
    [
        (np.eye(4) - 1.0) / 60.0,
        (1.0 + (np.arange(4)[:, None, None] == curved_cells.EDGES).any(axis=2)) / 30.0,
    ],
    axis=1,
)
"""Those of a barycentric coordinate and a quadratic shape function."""
_TO_LINEAR = np.linalg.solve(_PRODUCTS, _MOMENTS)
"""Corner values (4, 10) of the linear function that is nearest to a quadratic one in a cell: both
give the same forces, since strains are linear there."""


def free_strain(problem: Problem, case: str) -> FloatArray | None:
    """Free thermal strain (m, 4, 6) at the corners of each cell, linear between; None without heat.

    Voigt, with engineering shear, in the global frame; of a load case or a combination.
    """
    mesh = problem.mesh
    change = np.zeros(len(mesh.points))
    for name, factor in problem.factors(case).items():
        for load in problem.loads.get(name, ()):
            if isinstance(load, load_kinds.Temperature):
                change += factor * temperature_change(mesh, load)
    if not change[mesh.cells].any():
        return None
    result = np.empty((len(mesh.cells), 4, 6))
    for material, cells in problem.materials:
        if material.expansion is None:
            raise InputError(
                f"a change of temperature needs the expansion of material '{material.name}', 1/K, "
                "which has none: give it one"
            )
        strain = np.diag(material.expansion)
        if problem.axes is not None:
            axes = problem.axes[cells]
            strain = axes @ strain @ np.swapaxes(axes, 1, 2)
        at_corners = change[mesh.cells[cells]]
        if mesh.order == 2:
            at_corners = at_corners @ _TO_LINEAR.T
        result[cells] = at_corners[:, :, None] * strain_to_voigt(strain).reshape(-1, 1, 6)
    return result


def heat_forces(problem: Problem, case: str) -> FloatArray:
    """Find the nodal forces (n, 3), N, of thermal expansion."""
    free = free_strain(problem, case)
    if free is None:
        return np.zeros(problem.mesh.points.shape)
    stress = times(problem.cell_stiffness, free)
    if problem.density is not None:
        stress = stress * problem.density[:, None, None]
    return strain_forces(problem.mesh, stress)


def strain_forces(mesh: TetMesh, stress: FloatArray) -> FloatArray:
    """Find the forces at the nodes (n, 3), N, of a stress (m, 6), MPa, Voigt, in each cell.

    They are ``int B^T s dV``: the effect of an initial stress -s on the part. Stress (m, 4, 6) at
    the corners of the cells is linear between.
    """
    corner = stress if stress.ndim == 3 else stress[:, None]
    s = corner[..., [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(*corner.shape[:2], 3, 3)
    gradients = cell_gradients(mesh)
    volumes = signed_volumes(mesh.points, mesh.corners)[:, None, None]
    mean = s.mean(axis=1)
    forces = volumes * (gradients @ mean)
    if mesh.order == 2:
        # Gradients of corner functions have mean zero, those of a midpoint that of its corners.
        i, j = mesh.edges.T
        forces = np.concatenate([np.zeros_like(forces), forces[:, i] + forces[:, j]], axis=1)
        if stress.ndim == 3:
            # The integrals of (4 L_i - 1) s and of 4 L_j s beyond those of the mean stress.
            off = volumes[:, None] * (s - mean[:, None]) / 5.0
            forces[:, :4] += _row_times(gradients, off)
            forces[:, 4:] += _row_times(gradients[:, i], off[:, j])
            forces[:, 4:] += _row_times(gradients[:, j], off[:, i])
        if len(mesh.curved):
            forces[mesh.curved] = _curved_strain_forces(mesh, s[mesh.curved])
    return _summed(mesh, forces)


def _row_times(gradients: FloatArray, stress: FloatArray) -> FloatArray:
    """Products (m, q, 3) of gradients (m, q, 3) and stresses (m, q, 3, 3)."""
    return np.asarray(np.einsum("maj,majk->mak", gradients, stress))


def _curved_strain_forces(mesh: TetMesh, stress: FloatArray) -> FloatArray:
    """Do the same, (c, 10, 3), in the cells with curved sides, of a stress (c, 1 or 4, 3, 3)."""
    nodes = mesh.points[mesh.cells[mesh.curved]]
    forces = np.zeros(nodes.shape)
    for weight, at in zip(curved_cells.CELL_WEIGHTS, curved_cells.CELL_POINTS, strict=True):
        shares = at if stress.shape[1] == 4 else np.ones(1)
        here = np.einsum("a,maij->mij", shares, stress)
        volume = weight / 6.0 * curved_cells.jacobians(nodes, at)
        forces += volume[:, None, None] * (curved_cells.gradients_at(nodes, at) @ here)
    return forces
