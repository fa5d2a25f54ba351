"""Pinned joints: at which load the matrix round a loaded hole gives way, by engineering formulas.

First failure leaves out what lies near loads and supports, so that it does not see a pin that tears
out of its hole. The three ways in which it does are judged here as in the design of pinned joints
and lugs: by mean stresses on the areas that would part, which are measured in the mesh.

* bearing: the pin crushes the wall, ``F / (d t)`` against the compressive strength; of a part of a
  wall, as at a plane of symmetry, its own width across the force counts in place of ``d``. With
  infill only the share counts that is filled, up to a radius ahead of the wall: a few lines round
  a hole are crushed with what does not hold them;
* net section: the material beside the hole breaks, ``F / ((W - d) t)`` against the tensile one;
* strand pull-out: where strands cross the net section, they go on holding when the matrix there has
  cracked, until they break or are pulled out (`ccfem.judging.virtual_testing.anchorage`). The joint
  parts beside the hole at the larger of the two;
* shear-out: what lies ahead of the pin is pushed out between two planes that touch the hole along
  the force, ``F / (2 e t)`` against the tensile strength over the root of 3 (von Mises).

All other strengths are those of the matrix. Strands ahead of the pin are not counted: no strength
of printed ones in such a joint is known here.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh.smooth_faces import Face, given_faces
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.load_kinds import patches_in_use
from ccfem.geometry.facets import connected, facet_keys
from ccfem.judging.virtual_testing.anchorage import Anchorage
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.judging.virtual_testing.strands import cut_steps

BEARING, NET_SECTION, SHEAR_OUT = "bearing", "net section", "shear-out"
PULL_OUT = "strand pull-out"

_HEIGHTS = 5
"""Places along the axis at which a hole's surroundings are measured."""
_HALF = 120.0
"""Least turn of a loaded wall, degrees: a fillet turns by less, half a hole by more."""
_AHEAD = np.radians((-45.0, 0.0, 45.0))
"""Places on a wall, from the force on, ahead of which it is looked at whether it is filled."""
_IDLE = 1e-3
"""Share of the load of the part below which a hole is not loaded across its axis."""
_STRAIGHT = 0.7
"""Least cosine between the force and the middle of the round end of a slot that takes it."""
_ROUND = 0.02
"""Share of its area by which a wall goes all round, and along one axis: as for round walls."""
_OFF = 0.01
"""Distance of the planes of shear-out from the hole, in radii: chords of the wall lie inside it."""
_GAP = 0.05
"""Gap in the material along a ray, mm, that is rounding: a line of plastic is wider."""


@dataclass(frozen=True)
class PinnedJoint:
    """A hole across which a pin presses, and when the matrix round it gives way."""

    patch: str  # of a load or a support on its wall
    centre: FloatArray  # (3,), mm: on the axis, in the middle of the wall
    # (3,), N: of the pin on the part, across the axis, under the load of the test
    force: FloatArray
    # mm: diameter of the hole; thickness: length of its loaded wall along the axis
    diameter: float
    thickness: float
    # mm^2: of the material beside the hole across the force, and of both planes of shear-out
    net_area: float
    shear_area: float
    # by mode, N: load of the part at which each mode happens. Infinite for the net section where it
    # is pressed; none of a mode without material that could part. That of strands in the net
    # section is there where they hold anything.
    loads: Mapping[str, float]

    def __post_init__(self) -> None:
        freeze(self, centre=float, force=float, loads=dict)

    @property
    def mode(self) -> str:
        """The mode that happens first: of matrix and strands beside the hole the later one."""
        spared = set()
        if PULL_OUT in self.loads and NET_SECTION in self.loads:
            spared = {min((PULL_OUT, NET_SECTION), key=self.loads.__getitem__)}
        return min((mode for mode in self.loads if mode not in spared), key=self.loads.__getitem__)

    @property
    def load(self) -> float:
        """Load of the part at which it does, N."""
        return self.loads[self.mode]

    @property
    def about(self) -> str:
        """One phrase: what happens first, where, at which load, and what else might."""
        others = [
            f"{mode} {load:.0f}"
            for mode, load in self.loads.items()
            if mode != self.mode and np.isfinite(load)
        ]
        rest = f" ({', '.join(others)})" if others else ""
        return f"{self.mode} of '{self.patch}' at {self.load:.0f} N{rest}"


def pinned_joints(
    stress: StressField,
    forces: FloatArray,
    size: float,
    limits: Limits,
    anchorage: Anchorage | None = None,
) -> tuple[PinnedJoint, ...]:
    """Judge every hole whose wall carries a load or a support, the weakest first.

    Parameters
    ----------
    stress : StressField
        With its reactions.
    forces : (n, 3) array, N
        Of the loads at the nodes.
    size : float, N
        Of the load of the part; loads at failure are in its terms.
    limits : Limits
        Its strength of the matrix is the tensile one.
    anchorage : Anchorage, optional
        Strands, and how they are held; default: none are counted.
    """
    joints = [
        _joint(stress, hole.face, hole.patch, hole.facets, hole.force, size, limits, anchorage)
        for hole in _holes(stress, forces, size)
        if hole.face is not None
    ]
    return tuple(sorted(joints, key=lambda joint: joint.load))


def pins_not_judged(stress: StressField, forces: FloatArray, size: float) -> str:
    """Say in which holes pins press where the wall is no cylinder; empty without any."""
    names = dict.fromkeys(h.patch for h in _holes(stress, forces, size) if h.face is None)
    if not names:
        return ""
    listed = ", ".join(f"'{name}'" for name in names)
    return f"pins are not judged in {listed}: loaded where the wall of the hole is no cylinder"


class _Hole(NamedTuple):
    """Loaded hole: the patch, its wall or round end (None where it is not round) and the force."""

    patch: str
    face: Face | None
    facets: IntArray
    force: FloatArray


def _holes(stress: StressField, forces: FloatArray, size: float) -> Iterator[_Hole]:
    """Find the holes across which a pin presses."""
    problem, mesh = stress.problem, stress.mesh
    loaded = patches_in_use((), {stress.case: problem.loads_of(stress.case)})
    held = patches_in_use(problem.all_supports, {})
    for name in sorted({*loaded, *held}):
        facets = mesh.patch(name)
        # At the rim the nodes are also those of other patches: their supports are not the pin.
        outer = forces * (name in loaded) + stress.reactions * (name in held)
        for whole in given_faces(mesh.points, facets, _pieces(facets)):
            face: Face | None = whole
            piece = facets[whole.facets]
            force = outer[np.unique(mesh.facet_nodes(piece))].sum(axis=0)
            axis, hollow = whole.direction, whole.hollow and whole.turn >= _HALF
            if whole.kind != "cylinder":
                axis, hollow = _axis_of_hole(mesh, piece)
            force = force - (force @ axis) * axis
            if not hollow or np.linalg.norm(force) <= _IDLE * size:
                continue
            if whole.kind != "cylinder":
                face, piece = _end_ahead(mesh, piece, force)
            yield _Hole(name, face, piece, force)


def _axis_of_hole(mesh: TetMesh, facets: IntArray) -> tuple[FloatArray, bool]:
    """Axis (3,) along which a wall runs, and whether it is that of a hole and goes all round."""
    area, normal = mesh.facet_areas(facets)
    total = area.sum()
    spread, axes = np.linalg.eigh((area * normal.T) @ normal / total)
    middles = mesh.points[facets].mean(axis=1)
    inward = np.einsum("ki,ki->k", area @ middles / total - middles, normal)
    closed = np.linalg.norm(area @ normal) < _ROUND * total
    return axes[:, 0], bool(closed and spread[0] < _ROUND and area @ inward > 0.0)


def _end_ahead(mesh: TetMesh, facets: IntArray, force: FloatArray) -> tuple[Face | None, IntArray]:
    """Round end of a slot against which a force presses a pin, and its facets; None without."""
    keys, boundary = facet_keys(facets, mesh.boundary)
    order = np.argsort(boundary, kind="stable")
    wall_of = mesh.wall_of[order[np.searchsorted(boundary, keys, sorter=order)]]
    for wall in np.unique(wall_of[wall_of >= 0]).tolist():
        end = facets[wall_of == wall]
        (face,) = given_faces(mesh.points, end, [np.arange(len(end))])
        area, normal = mesh.facet_areas(end)
        ahead = -(area @ normal) @ force
        straight = ahead >= _STRAIGHT * np.linalg.norm(area @ normal) * np.linalg.norm(force)
        if face.kind == "cylinder" and face.hollow and face.turn >= _HALF and straight:
            return face, end
    return None, facets


def about_pins(stress: StressField) -> str:
    """Say at which load a pin tears out of a part without fibre; empty where no pin is judged."""
    strength = stress.material.tensile_strength
    if strength is None or stress.problem.case_supports:
        return ""
    try:
        specimen = Specimen.of(stress)
    except InputError as error:
        return f"pins in holes are not judged: {error}"
    size = specimen.force(stress.reactions)
    joints = pinned_joints(stress, specimen.forces, size, Limits.of(stress.material))
    return said_of_pins(joints, pins_not_judged(stress, specimen.forces, size))


COUNTED = "the matrix, and strands beside a hole; those ahead of a pin are not counted"
"""What the loads of joints rest on."""


def said_of_pins(joints: Sequence[PinnedJoint], besides: str = "") -> str:
    """Remark on the weakest of some joints, which comes first, and `pins_not_judged` besides."""
    if not joints:
        return besides
    remark = (
        f"pins in holes, not part of first failure: {joints[0].about}, of {len(joints)} "
        f"hole{'s' * (len(joints) > 1)}, by {COUNTED}"
    )
    return "; ".join(filter(None, [remark, besides]))


def _pieces(facets: IntArray) -> list[IntArray]:
    """Rows of facets (k, 3) that hang together by their nodes: a patch may be several holes."""
    nodes, local = np.unique(facets, return_inverse=True)
    local = local.reshape(facets.shape)
    label = connected(np.concatenate([local[:, :2], local[:, 1:]]), len(nodes))[local[:, 0]]
    return [np.flatnonzero(label == k) for k in np.unique(label)]


def _joint(
    stress: StressField,
    wall: Face,
    patch: str,
    facets: IntArray,
    force: FloatArray,
    size: float,
    limits: Limits,
    anchorage: Anchorage | None,
) -> PinnedJoint:
    """Measure the surroundings of one hole, and judge them."""
    mesh, axis, radius = stress.mesh, wall.direction, wall.radius
    heights = (mesh.points[np.unique(facets)] - wall.centre) @ axis
    low, thickness = float(heights.min()), float(np.ptp(heights))
    steps = low + (np.arange(_HEIGHTS) + 0.5) / _HEIGHTS * thickness
    middles = wall.centre + steps[:, None] * axis
    pull = float(np.linalg.norm(force))
    ahead = force / pull
    aside = np.cross(axis, ahead)
    touching = (1.0 + _OFF) * radius * aside
    beside = [_rays(stress, middles + way * radius * aside, way * aside) for way in (1.0, -1.0)]
    shorn = [_rays(stress, middles + way * touching, ahead) for way in (1.0, -1.0)]
    net_area, shear_area = (
        thickness / _HEIGHTS * sum(float(ray.filled.sum()) for ray in rays)
        for rays in (beside, shorn)
    )
    stretched = sum(
        float(np.einsum("k,kij,i,j->", ray.filled, stress.stress[ray.cell], ahead, ahead))
        for ray in beside
    )
    places = np.cos(_AHEAD)[:, None] * ahead + np.sin(_AHEAD)[:, None] * aside
    crushed = _rays(stress, (middles[:, None] + radius * places).reshape(-1, 3), ahead, radius)
    solid = float(crushed.filled.sum() / crushed.length.sum()) if len(crushed.cell) else 1.0
    material = stress.problem.material
    bearing = limits.matrix
    if material.compressive_strength is not None:
        bearing = material.compressive_strength
    strengths = {
        BEARING: solid * bearing * radius * _width(stress, wall, facets, aside) * thickness,
        NET_SECTION: limits.matrix * net_area if stretched > 0.0 else np.inf,
        SHEAR_OUT: limits.matrix / np.sqrt(3.0) * shear_area,
    }
    if anchorage is not None and stretched > 0.0:
        wide = [radius + float(ray.length.sum()) / _HEIGHTS for ray in beside]
        rows = [(radius, wide[0], low, low + thickness), (-wide[1], -radius, low, low + thickness)]
        frame = np.array([ahead, aside, axis])
        strengths[PULL_OUT] = anchorage.held(wall.centre, frame, np.array(rows), limits.fibre)
    return PinnedJoint(
        patch,
        centre=wall.centre + (low + 0.5 * thickness) * axis,
        force=force,
        diameter=2.0 * radius,
        thickness=thickness,
        net_area=net_area,
        shear_area=shear_area,
        loads={mode: size * float(most) / pull for mode, most in strengths.items() if most > 0.0},
    )


def _width(stress: StressField, wall: Face, facets: IntArray, aside: FloatArray) -> float:
    """Width of a wall along a direction across its axis, in radii: 2 of half a turn ahead or more.

    The wall reaches as far as the point of its arc that is nearest to the direction, both ways.
    """
    area, normal = stress.mesh.facet_areas(facets)
    middle = area @ normal - (area @ normal @ wall.direction) * wall.direction
    cosine = float(middle @ aside) / max(float(np.linalg.norm(middle)), 1e-300)
    off = np.degrees(np.arccos(np.clip([cosine, -cosine], -1.0, 1.0))) - 0.5 * wall.turn
    return float(np.cos(np.radians(np.maximum(off, 0.0))).sum())


class _Rays(NamedTuple):
    """What rays cross up to their first gap: cells (k,), way in each, and what of it is filled."""

    cell: IntArray
    length: FloatArray
    filled: FloatArray


def _rays(stress: StressField, start: FloatArray, along: FloatArray, most: float = np.inf) -> _Rays:
    """Follow rays from points (r, 3), on the wall of a hole, through the part, at most so far."""
    mesh, fill = stress.mesh, stress.problem.fill
    reach = min(float(np.linalg.norm(np.ptp(mesh.points, axis=0))), most)
    step = np.broadcast_to(reach * along, start.shape)
    cut = cut_steps(start, step.copy(), np.full(len(start), reach), mesh)
    end, kept = np.zeros(len(start)), []
    for k in np.lexsort((cut.begin, cut.step)).tolist():
        ray = cut.step[k]
        if cut.begin[k] * reach <= end[ray] + _GAP:
            end[ray] = max(end[ray], cut.end[k] * reach)
            kept.append(k)
    length = (cut.end - cut.begin)[kept] * cut.share[kept] * reach
    cell = cut.cell[kept]
    return _Rays(cell, length, length if fill is None else length * fill[cell])
