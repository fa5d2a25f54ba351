"""Curved layers that follow the stress and are normal to the bolts: Fang et al. 2024.

G. Fang, T. Zhang, Y. Huang, Z. Zhang, K. Masania, C. C. L. Wang, Exceptional mechanical performance
by spatial printing with continuous fiber: Curved slicing, toolpath generation and physical
verification, arXiv:2311.17265. ``form="literal"`` is the term of the paper for the joints. The
default makes layers like those that the authors published.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PartStress
from ccfem.machine.machine import Machine
from ccfem.slicing.guidance.joints import Joint, joint_lines, joints_of
from ccfem.slicing.guidance.scalar_guidance import (
    FieldQuality,
    GuidanceField,
    JointForm,
    Weights,
    field_quality,
    guidance_field,
)
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_surfaces import level_surfaces
from ccfem.slicing.layers.slicer import Vector
from ccfem.slicing.principal_lines.critical import CriticalRegion, Keep
from ccfem.slicing.principal_lines.tracing import mean_edge
from ccfem.slicing.slicers.planar import Planar

_THICKNESS = 0.5
"""Default nominal thickness, mm: the published layers are 0.53 mm apart."""
_SMOOTH_OVER = 1.0 / 30.0
"""Length over which the field is smoothed, as a share of the part's diagonal."""
_SHORTEST = 0.3
"""Shortest edge of the layers' triangles, in mean edges of the mesh."""
_FLAT_SHARE = 0.95
_MOST_FOLDED = 0.02
"""Share of the area between cells above which the layers count as folded."""


@dataclass(frozen=True)
class SpatialSlicing:
    """Curved layers, and the data they were made from.

    Attributes
    ----------
    region : CriticalRegion
        Stress lines that join the joints.
    step : float
        Difference of the field between layers.
    bubbles, specks : int
        Numbers of pieces left out because they are closed, or too small.
    """

    layers: tuple[Layer, ...]
    field: GuidanceField
    region: CriticalRegion
    joints: tuple[Joint, ...]
    quality: FieldQuality
    step: float
    bubbles: int
    specks: int


@dataclass(frozen=True)
class Spatial:
    """Layers along the strongest stress where it carries the load, and normal to the bolt holes.

    Attributes
    ----------
    joints : tuple of str, default ()
        Patches where bolts sit; by default all that are held or loaded. A patch on part of the wall
        of a hole represents the whole hole.
    thickness : float, mm, optional
        Mean thickness of the layers, by default 0.5.
    count : int, optional
        Number of layers instead.
    stress_weight : float, default 1
        Weight of layers along the stress.
    smoothness : float, default 0.01
        Weight of equal gradients in neighbouring cells.
    joint_weight : float, default 1
        Weight of layers normal to the axes of the joints; smaller values follow the stress better.
        An axis is the one that the rule of the patch states, else that of its wall.
    hole_weight : float, default 0
        Further weight of layers normal to the axes of bolt holes near their walls, so that strands
        can wind round them (Zhang et al. 2025).
    hole_reach : float, mm, default 2
        Distance from the walls up to which it counts.
    length : float, mm, optional
        Length over which the field is smoothed; by default a thirtieth of the part's diagonal.
    form : {"axis", "ring", "literal"}
        Term of the joints: normal to their axes; one value in each slab; one value (the paper).
    rings : int, default 4
        Extent of a joint, in edges round the wall of its hole.
    directions : table of patch to three numbers
        Stacking direction of the layers in a joint, instead of the axis of its hole.
    signs : list of 1 and -1, optional
        Sense in which the layers are stacked along the axis of each joint; by default those of
        the lowest energy.
    lines : {"joining", "touching", "all"}
        Stress lines that count: those that join a held joint with a loaded one (or any two joints,
        if the stress does not tell which are held or loaded), those that reach a joint, or all.
    shortest_edge : float, mm, optional
        Shortest edge of the layers' triangles, by default 0.3 mean edges of the mesh.
    least_area : float, mm^2, default 5
        Smaller pieces of layers are left out.
    flat_within : float, degrees, default 1
        If the gradient of the field is within this angle of one direction in 95 % of the part, the
        layers are flat.
    """

    joints: tuple[str, ...] = ()
    thickness: float | None = None
    count: int | None = None
    stress_weight: float = 1.0
    smoothness: float = 0.01
    joint_weight: float = 1.0
    hole_weight: float = 0.0
    hole_reach: float = 2.0
    length: float | None = None
    form: JointForm = "axis"
    rings: int = 4
    directions: dict[str, Any] = field(default_factory=dict)
    signs: tuple[int, ...] | None = None
    lines: Keep = "joining"
    shortest_edge: float | None = None
    least_area: float = 5.0
    flat_within: float = 1.0

    def __post_init__(self) -> None:
        if self.thickness is not None and self.count is not None:
            raise InputError("spatial layers need one of thickness and count; got both: choose one")
        check_choices(self)
        positive = ("thickness", "count", "smoothness", "length", "rings", "shortest_edge")
        check_fields(self, *positive, above=0.0)
        free = ("stress_weight", "joint_weight", "hole_weight", "hole_reach")
        check_fields(self, *free, "least_area", "flat_within", at_least=0.0)

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Cut a part into curved layers."""
        return self.slice(stress, build).layers

    def slice(self, stress: PartStress, build: Vector = (0.0, 0.0, 1.0)) -> SpatialSlicing:
        """Cut a part into curved layers, and return the data they were made from too.

        Parameters
        ----------
        build : tuple of 3 floats, default z
            Layers are counted along this direction.

        Raises
        ------
        InputError
            When no stress line joins the joints, the part is thinner than two layers, or layers
            fold back on themselves.
        """
        mesh = stress.mesh
        joints = joints_of(stress, self.joints, self.rings, self.directions)
        strongest, region = joint_lines(stress, joints, self.lines)
        diagonal = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
        length = diagonal * _SMOOTH_OVER if self.length is None else self.length
        holes = (self.hole_weight, self.hole_reach)
        weights = Weights(self.stress_weight, self.smoothness, self.joint_weight, length, *holes)
        up = np.asarray(build, dtype=np.float64)
        guidance = guidance_field(
            mesh,
            strongest.direction,
            region.weight,
            joints,
            weights,
            self.form,
            self.signs,
            _THICKNESS if self.thickness is None else self.thickness,
            up / np.linalg.norm(up),
        )
        # A field that is nearly linear gives flat layers, which can be printed with three axes.
        normal = _flat(guidance, joints, up, self.flat_within)
        values = guidance.values if normal is None else mesh.points @ normal
        # The field has a mean gradient of 1: its range is a height.
        low, high = np.quantile(values[mesh.corners], [0.0, 1.0])
        count = self._count(high - low)
        step = float(high - low) / count
        nominal = step if self.thickness is None and self.count is not None else self._nominal
        quality = field_quality(guidance, strongest.direction, region.weight, step, nominal)
        if quality.folded > _MOST_FOLDED:
            raise InputError(
                f"layers fold back on themselves over {100 * quality.folded:.1f} % of the part: "
                "raise smoothness, lower joint_weight, or choose other signs or joints"
            )
        if normal is not None:
            layers, bubbles, specks = Planar(count=count).cut(mesh, _vector(normal)), 0, 0
        else:
            edge = self.shortest_edge or _SHORTEST * mean_edge(mesh)
            levels = low + (np.arange(count) + 0.5) * step
            surfaces = level_surfaces(mesh, guidance.values, levels, step, edge, self.least_area)
            layers, bubbles, specks = surfaces.layers, surfaces.bubbles, surfaces.specks
        return SpatialSlicing(layers, guidance, region, joints, quality, step, bubbles, specks)

    def remarks(self, stress: PartStress) -> tuple[str, ...]:
        """Say which joints have no axis that layers could be normal to."""
        joints = joints_of(stress, self.joints, self.rings, self.directions)
        return tuple(
            f"joint '{joint.name}' has no axis, since its wall is too rough for a cylinder: its "
            f"joint_weight does nothing; state the axis (slicing.directions.{joint.name} = [x, y, "
            "z]), or take rule 'cylinder' with an axis"
            for joint in joints
            if joint.dropped
        )

    @property
    def _nominal(self) -> float:
        return _THICKNESS if self.thickness is None else self.thickness

    def _count(self, height: float) -> int:
        """Count the layers that fit a range of the field, mm."""
        if self.count is not None:
            return self.count
        count = round(height / self._nominal)
        if count < 1:
            raise InputError(
                f"layers of {self._nominal:g} mm do not fit a part that is {height:.3g} mm high "
                "along the field: give a smaller thickness, or a count"
            )
        return count


def _flat(
    guidance: GuidanceField, joints: Sequence[Joint], build: FloatArray, within: float
) -> FloatArray | None:
    """Direction of a field whose gradient has the same one, within an angle, in 95 % of the part.

    If it is within that angle of the build direction or of a joint's direction, return that one.
    """
    volume, limit = guidance.mesh.volumes, np.cos(np.radians(within))
    mean = volume @ guidance.gradient
    size = np.linalg.norm(guidance.gradient, axis=1)
    if not np.linalg.norm(mean) > 0.0:
        return None
    mean = mean / np.linalg.norm(mean)
    near = guidance.gradient @ mean >= limit * size
    if volume[near].sum() < _FLAT_SHARE * volume.sum():
        return None
    for axis in (build, *(j.direction for j in joints if j.direction is not None)):
        unit = axis / np.linalg.norm(axis)
        if abs(unit @ mean) >= limit:
            return unit * np.sign(unit @ mean)
    return np.asarray(mean)


def _vector(direction: FloatArray) -> Vector:
    x, y, z = direction.tolist()
    return (x, y, z)
