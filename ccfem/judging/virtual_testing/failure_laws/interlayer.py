"""Strength between layers: the averaged traction on the layer against what the bond holds.

The stress tensor of the matrix is averaged over a ball (averaging over a length: Whitney and
Nuismer, J. Composite Materials 8, 1974, 253-265). Its traction on the layer is judged by the
quadratic criterion ``f^2 = (max(t_n, 0) / Z)^2 + (t_s / S)^2``, t_n opening the layers and t_s
sliding them on each other. Compression across layers neither harms nor helps. The index serves to
compare layers of one part under the same supports and to find where layers open. It does not serve
for absolute loads: strengths published for one material differ by a factor of 2.4.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.tensor import from_voigt
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.zone import BALL, ZONE, ball_averages, distance_from_patches
from ccfem.fem.materials import Material
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.judging.virtual_testing.strand import Failure, Limits
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import flat_layers

ZONES = (ZONE, 0.5 * ZONE, 0.0)
"""Distances, mm, from patches of loads and supports within which nothing is judged. The first gives
the result; the others show how much it depends on the zone."""

_NEAREST = 6
"""Triangles of curved layers that give the normal of a cell."""

_ROUNDING = 1e-6
"""Traction, over the largest averaged stress, that counts as rounding error of a solve."""


@dataclass(frozen=True)
class Interlayer:
    """When and where layers first come apart.

    Attributes
    ----------
    index : float
        Largest f outside the first zone: 1 at failure.
    where : (3,) array, mm
        Middle of the cell that has it.
    opening, sliding : float, MPa
        Traction across the layer there, negative where it presses, and in the layer.
    zone_indices : tuple of 3 floats
        Largest f outside each of `ZONES`; the first is `index`.
    note : str
        Where the ball is smaller than the cells; else empty.
    """

    index: float
    where: FloatArray
    opening: float
    sliding: float
    zone_indices: tuple[float, ...]
    note: str = ""

    def __post_init__(self) -> None:
        freeze(self, where=float)


def fails(test: VirtualTest, _: Limits, layers: Sequence[Layer] | None) -> Failure:
    """Load at which printed layers come apart; not judged without layers or strengths."""
    if layers is None:
        return Failure(note="bond between layers not judged: no layers were given")
    try:
        bond = interlayer(test.solution, layers)
    except InputError as error:
        return Failure(note=f"bond between layers not judged: {error}")
    zones = tuple(test.force / f if f > 0.0 else np.inf for f in bond.zone_indices)
    values = {
        "interlayer_load": zones[0],
        "interlayer_index": bond.index,
        "interlayer_where": bond.where,
        "opening": bond.opening,
        "sliding": bond.sliding,
        "interlayer_zones": zones,
    }
    return Failure(zones[0], bond.where, bond.note, values)


def index(stress: FloatArray, limits: Limits, normal: FloatArray | None) -> FloatArray | None:
    """Return f at averaged stresses (k, 3, 3) on layers of normals (k, 3); None without either."""
    if limits.bond is None or normal is None:
        return None
    return _criterion(*_across_and_along(stress, normal), *limits.bond)


def _across_and_along(tensor: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Traction (k,) across layers, positive where it opens them, and the size of that in them."""
    traction = np.einsum("mij,mj->mi", tensor, normal)
    opening = np.einsum("mi,mi->m", traction, normal)
    return opening, np.linalg.norm(traction - opening[:, None] * normal, axis=1)


def _criterion(
    opening: FloatArray, sliding: FloatArray, tensile: float, shear: float
) -> FloatArray:
    """Quadratic criterion: 1 at failure."""
    return np.asarray(np.hypot(np.maximum(opening, 0.0) / tensile, sliding / shear))


def interlayer(
    stress: StressField,
    layers: Sequence[Layer],
    material: Material | None = None,
    radius: float = BALL,
) -> Interlayer:
    """Judge the bond between layers under the load of a solution.

    Parameters
    ----------
    stress : StressField
        Of the matrix, with fibres or without.
    layers : sequence of Layer
        At least one. Their normals count, not their distance.
    material : Material, optional
        With the strengths between layers; default that of the part.
    radius : float, mm, default 2
        Radius of the ball. Below the mean edge of the cells the result depends on the mesh, and a
        note says so.

    Raises
    ------
    InputError
        Where the material has no interlayer strength, and where all cells lie in the zone of a
        load or a support.
    """
    material = stress.problem.material if material is None else material
    tensile, shear = material.interlayer_tensile, material.interlayer_shear
    if tensile is None:
        raise InputError(
            f"material '{material.name}' has no strength between layers: give interlayer_tensile, "
            "MPa, measured on a bar printed upright"
        )
    check_number("radius of the ball", radius, above=0.0, unit="mm")
    mesh = stress.mesh
    centroid = mesh.centres
    distance = distance_from_patches(stress.problem, stress.case, centroid, ZONE)
    if not (distance > ZONE).any():
        raise InputError(
            f"no cell lies farther than {ZONE:g} mm from the patches of loads and supports, so the "
            "bond between layers cannot be judged: the part is too small for this index"
        )
    # Singular stress at corners depends on the mesh; its mean over a ball does not.
    opening, sliding, tensor = layer_traction(stress, layers, np.arange(len(centroid)), radius)
    shear = tensile if shear is None else shear
    index = _criterion(opening, sliding, tensile, shear)
    index[np.hypot(np.maximum(opening, 0.0), sliding) <= _ROUNDING * np.abs(tensor).max()] = 0.0
    zones = tuple(float(index[distance > zone].max()) for zone in ZONES)
    peak = int(np.where(distance > ZONE, index, -1.0).argmax())
    return Interlayer(
        index=zones[0],
        where=centroid[peak],
        opening=float(opening[peak]),
        sliding=float(sliding[peak]),
        zone_indices=zones,
        note=_about_ball(mesh, radius),
    )


def layer_traction(
    stress: StressField, layers: Sequence[Layer], cells: IntArray, radius: float = BALL
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Traction of the averaged stress on the layers at the middle of some cells (k,).

    Returns
    -------
    opening, sliding : (k,) arrays, MPa
        Across the layers, positive where it opens them, and the size of that along them.
    tensor : (k, 3, 3) array, MPa
        The averaged stress of the material.
    """
    mesh = stress.mesh
    centre = mesh.centres
    values = stress.problem.in_material(stress.stress).reshape(-1, 9)
    tensor = ball_averages(centre, values, mesh.volumes, cells, radius).reshape(-1, 3, 3)
    return *_across_and_along(tensor, layer_normals(layers, centre[cells])), tensor


def layer_normals(layers: Sequence[Layer], places: FloatArray) -> FloatArray:
    """Find the unit normals (k, 3) of the layers at places (k, 3), of either sign.

    For flat layers, the normal of their plane. For curved layers, the axis nearest to the normals n
    of the six nearest triangles: the first eigenvector of the sum of ``n n^T``. Vectors are never
    averaged, since a normal has no sign.
    """
    frames = [layer.plane.frame[2] for layer in flat_layers(layers)]
    if not layers:
        raise InputError("the bond between layers needs layers; got none: slice the part")
    if len(frames) == len(layers) and (np.ptp(frames, axis=0) == 0.0).all():
        return np.broadcast_to(frames[0], places.shape)
    area = np.concatenate([layer.areas for layer in layers]) > 0.0
    normal = np.concatenate([layer.normals for layer in layers])[area]
    middle = np.concatenate([layer.points[layer.triangles].mean(axis=1) for layer in layers])[area]
    _, near = cKDTree(middle).query(places, k=min(_NEAREST, len(middle)))
    normals = normal[near.reshape(len(places), -1)]
    return np.asarray(np.linalg.eigh(np.einsum("kni,knj->kij", normals, normals))[1][:, :, -1])


def _about_ball(mesh: TetMesh, radius: float) -> str:
    """Say where the ball is smaller than the cells."""
    ends = mesh.points[mesh.corners][:, TetMesh.edges]
    edge = float(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).mean())
    if radius >= edge:
        return ""
    return (
        f"the stress between layers is averaged over {radius:g} mm, less than the mean edge of "
        f"the cells of {edge:.2g} mm, so its peak depends on the mesh: use smaller cells"
    )


# Cells whose layers part once the averaged traction reaches the strength of the bond: then they
# carry stress within their layers alone.


_LEFT = 1e-3
"""Share that parted layers keep of what they carried across: no part falls to pieces."""


def parting_factors(
    mesh: TetMesh,
    stress: FloatArray,
    limits: Limits,
    normal: FloatArray,
    judged: IntArray,
    most: float = np.inf,
) -> FloatArray:
    """Factors (m,) on a load at which the layers of each cell part; infinite above `most`.

    Parameters
    ----------
    stress : (m, 6) array, MPa
        Of the matrix, in Voigt order.
    limits : Limits
        With strengths of the bond; without them nothing parts.
    normal : (m, 3) array
        Unit normals of the layers in the cells.
    judged : (k,) int array
        Cells whose layers may part.
    """
    factors = np.full(len(stress), np.inf)
    tensor = from_voigt(stress)
    alone = index(tensor, limits, normal)
    if alone is None:
        return factors
    # The index is convex: a mean over a ball never exceeds the largest in it.
    hot = alone >= 1.0 / most
    if not hot.any():
        return factors
    centres = mesh.centres
    if not hot.all():
        away, _ = cKDTree(centres[hot]).query(centres[judged], distance_upper_bound=1.001 * BALL)
        judged = judged[np.isfinite(away)]
    mean = ball_averages(centres, tensor.reshape(-1, 9), mesh.volumes, judged, BALL)
    nearness = index(mean.reshape(-1, 3, 3), limits, normal[judged])
    with np.errstate(divide="ignore"):
        factors[judged] = 1.0 / np.asarray(nearness)
    return np.where(factors <= most, factors, np.inf)


def parted_stiffness(stiffness: FloatArray, normal: FloatArray) -> FloatArray:
    """Stiffness (k, 6, 6) of cells without traction on their layers, but for a thousandth of it.

    Parameters
    ----------
    stiffness : (6, 6) or (k, 6, 6) array, MPa
    normal : (k, 3) array
    """
    x, y, z = normal.T
    none = np.zeros_like(x)
    # Traction (3,) on the layer is this times stress; its transpose makes strain of an opening.
    rows = [[x, none, none, none, z, y], [none, y, none, z, none, x], [none, none, z, y, x, none]]
    on = np.moveaxis(np.array(rows), 2, 0)
    across = stiffness @ on.transpose(0, 2, 1)
    lost = across @ np.linalg.solve(on @ across, across.transpose(0, 2, 1))
    return np.asarray(stiffness - (1.0 - _LEFT) * lost)
