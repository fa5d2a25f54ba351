"""Curved layers whose normal follows the least principal stress: Kipping and Schueppstuhl 2023.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998. The defaults differ from the paper where it
leaves layers flat, upside down, or undetermined. ``quantile=1, gap=0, blend=0, even=False`` gives
the paper's method.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PartStress
from ccfem.machine.machine import Machine
from ccfem.slicing.guidance.height_field import HeightField, height_field, inverted_share
from ccfem.slicing.guidance.normal_field import NormalField, normal_field
from ccfem.slicing.guidance.stress_regions import StressRegions, stress_regions
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.slicer import Vector
from ccfem.slicing.layers.sublayers import layers_within
from ccfem.slicing.principal_lines.tracing import mean_edge

# Share of the tension that acts across layers, where they are weakest.


_DIRECTIONS = 2000
"""Number of plane directions that are tried, over half a sphere: 3 degrees apart."""


@dataclass(frozen=True)
class Across:
    """Stress across layers, averaged by volume over the critical cells.

    Attributes
    ----------
    tension : float
        Tensile traction normal to the layer, over the largest principal stress.
    angle : float, degrees
        Between the normal of the layer and the direction of the least principal stress.
    """

    tension: float
    angle: float


def across_layers(
    stress: FloatArray, volume: FloatArray, critical: BoolArray, normal: FloatArray
) -> Across:
    """Measure layers of given normals, (m, 3) or (3,), of any length.

    Of stress (m, 3, 3), MPa, and volumes (m,), mm^3, the critical cells count, at least one.
    """
    normal = np.broadcast_to(normal, (len(stress), 3))[critical]
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    values, axes = np.linalg.eigh(stress[critical])
    pull = np.einsum("ei,eij,ej->e", normal, stress[critical], normal)
    share = np.maximum(pull, 0.0) / values[:, 2]
    cosine = np.abs(np.einsum("ed,ed->e", axes[:, :, 0], normal))
    weight = volume[critical]
    angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
    return Across(
        float(np.average(share, weights=weight)), float(np.average(angle, weights=weight))
    )


def best_plane(stress: FloatArray, volume: FloatArray, critical: BoolArray) -> FloatArray:
    """Find the normal (3,) of flat layers across which the least tension acts, to 3 degrees."""
    k = np.arange(_DIRECTIONS)
    z = (k + 0.5) / _DIRECTIONS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    out = np.sqrt(1.0 - z**2)
    tried = np.column_stack([out * np.cos(turn), out * np.sin(turn), z])
    tried = np.concatenate([np.eye(3), tried])
    weight = volume[critical] / np.linalg.eigvalsh(stress[critical])[:, 2]
    flat = stress[critical].reshape(-1, 9)
    products = np.einsum("ki,kj->kij", tried, tried).reshape(-1, 9)
    total = [float(weight @ np.maximum(flat @ product, 0.0)) for product in products]
    return np.asarray(tried[int(np.argmin(total))])


_SHORTEST = 0.15
"""Shortest edge of the layers' triangles, in mean edges of the mesh."""


@dataclass(frozen=True)
class LoadOrientedSlicing:
    """Curved layers, and the data they were made from.

    Attributes
    ----------
    step : float
        Difference of the field between layers.
    inverted : float
        Share of the volume in which the layers lie upside down.
    across, across_build, across_best : Across
        Stress across these layers, across flat layers normal to the build direction, and across
        those flat layers on which the least tension acts.
    best : (3,) array
        Normal of the last ones.
    """

    layers: tuple[Layer, ...]
    regions: StressRegions
    normals: NormalField
    field: HeightField
    step: float
    inverted: float
    across: Across
    across_build: Across
    across_best: Across
    best: FloatArray


@dataclass(frozen=True)
class LoadOriented:
    """Layers normal to the least principal stress where the largest is high.

    Attributes
    ----------
    thickness : float, mm, default 0.35
        Mean thickness of the layers.
    thinnest, thickest : float, mm, default 0.2 and 0.5
        Where layers would be thinner, every second one is left out; where they would be thicker,
        one is inserted in between. The second value is at least twice the first.
    share : float, default 0.16
        Layers follow the stress where its largest principal value is above this share of the peak.
    quantile : float, default 0.995
        Quantile, over the volume, of that stress which counts as the peak; the paper takes the
        maximum, 1.
    gap : float, default 0.1
        Layers follow the stress only where the other two principal stresses also differ by this
        share of the largest; the paper requires no difference, 0.
    alignment : float, default 0.75
        Least cosine of the angle between neighbours of one region.
    regions : int, default 10
        Number of regions that are followed, largest first.
    smoothing : int, default 200
        Passes that smooth the directions in a region.
    even : bool, default True
        Whether the field is changed as little as necessary where layers would leave the range of
        thickness. The paper only inserts layers and leaves layers out.
    blend : float, optional
        How much of the mean direction is added to all directions, which flattens the layers. By
        default as little as leaves no layer upside down and, with `even`, almost none outside the
        range of thickness; the paper adds none, 0.
    shortest_edge : float, mm, optional
        Shortest edge of the layers' triangles, by default 0.15 mean edges of the mesh.
    least_area : float, mm^2, default 3.3
        Smaller pieces of layers are left out.
    """

    thickness: float = 0.35
    thinnest: float = 0.2
    thickest: float = 0.5
    share: float = 0.16
    quantile: float = 0.995
    gap: float = 0.1
    alignment: float = 0.75
    regions: int = 10
    smoothing: int = 200
    even: bool = True
    blend: float | None = None
    shortest_edge: float | None = None
    least_area: float = 3.3

    def __post_init__(self) -> None:
        for name in ("thickness", "thinnest", "thickest", "shortest_edge"):
            check_fields(self, name, above=0.0, unit="mm")
        check_fields(self, "least_area", at_least=0.0, unit="mm^2")
        for name in ("share", "gap", "alignment"):
            check_fields(self, name, at_least=0.0, below=1.0)
        check_fields(self, "quantile", above=0.0, at_most=1.0)
        check_fields(self, "regions", at_least=1)
        check_fields(self, "smoothing", at_least=0)
        check_fields(self, "blend", at_least=0.0)
        if not self.thickest >= 2.0 * self.thinnest:
            raise InputError(
                "load_oriented.thickest must be at least twice thinnest, since extra layers are "
                f"inserted between two; got {self.thinnest:g} and {self.thickest:g} mm: widen the "
                "range"
            )
        if not self.thinnest <= self.thickness <= self.thickest:
            raise InputError(
                f"load_oriented.thickness must lie from {self.thinnest:g} to {self.thickest:g} mm; "
                f"got {self.thickness:g}: change it, or the range"
            )

    @property
    def _lengths(self) -> tuple[float, float] | None:
        """Range of the gradient's size for which layers are neither too thick nor too thin."""
        if not self.even:
            return None
        return self.thickness / self.thickest, self.thickness / self.thinnest

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Cut a part into curved layers, none of which lies upside down."""
        sliced = self.slice(stress, build)
        if sliced.inverted > 0.0:
            raise InputError(
                f"layers lie upside down in {100.0 * sliced.inverted:.2g} % of the part: raise "
                "load_oriented.blend, or leave it out to use the smallest value that is enough"
            )
        return sliced.layers

    def slice(self, stress: PartStress, build: Vector = (0.0, 0.0, 1.0)) -> LoadOrientedSlicing:
        """Cut a part into curved layers, and return the data they were made from too.

        Parameters
        ----------
        build : tuple of 3 floats, default z
            Layers are counted along this direction.

        Raises
        ------
        InputError
            When no region of critical stress is found, or the part is thinner than a layer.
        """
        mesh = stress.mesh
        up = np.asarray(build, dtype=np.float64)
        up = up / np.linalg.norm(up)
        regions = stress_regions(
            mesh,
            stress.stress,
            up,
            self.share,
            self.quantile,
            self.gap,
            self.alignment,
            self.regions,
            self.smoothing,
        )
        normals = normal_field(mesh, regions, up)
        field = height_field(mesh, normals.direction, self.blend, self._lengths)
        # A step of the field is a layer of the wanted thickness on average over the volume.
        steep = np.linalg.norm(field.gradient, axis=1)
        step = self.thickness * float(mesh.volumes @ steep / mesh.volumes.sum())
        if not float(np.ptp(field.values[mesh.corners])) > step:
            raise InputError(
                f"layers of {self.thickness:g} mm do not fit a part that is thinner along the "
                "stress: give a smaller thickness"
            )
        edge = self.shortest_edge or _SHORTEST * mean_edge(mesh)
        stack = layers_within(
            mesh, field.values, step, self.thinnest, self.thickest, edge, self.least_area
        )
        # Tension across the layers, beside that of flat layers and of the best plane.
        best = best_plane(stress.stress, mesh.volumes, regions.critical)
        ours, flat, least = (
            across_layers(stress.stress, mesh.volumes, regions.critical, normal)
            for normal in (field.gradient, up, best)
        )
        inverted = inverted_share(mesh, field.gradient, field.up)
        return LoadOrientedSlicing(
            stack.layers, regions, normals, field, step, inverted, ours, flat, least, best
        )
