"""Joints of a part: where bolts sit, found from the patches that are held or loaded."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.smooth_faces import fitted_cylinder
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.facets import connected
from ccfem.slicing.principal_lines.critical import (
    CriticalRegion,
    Keep,
    Strongest,
    critical_region,
    strongest_stress,
)

_AGREE = np.cos(np.radians(20.0))
"""Cosine of the angle up to which a stated axis and that of the wall are the same one."""
_FLAT = 0.02
"""Share of a patch's squared normals that may lie along the axis of a cylinder."""
_ROUND = 0.05
"""Largest distance of a cylinder's nodes from its surface, in radii."""
_ROUGH, _UNROUND = 0.1, 0.1
"""The same share of squared normals, and median distance of the nodes, of a rough wall."""
_ROUNDS = 20
"""Fits of the circle of a rough wall."""


@dataclass(frozen=True)
class Joint:
    """A joint: the wall of a bolt hole, or any other patch, and the part round it.

    Attributes
    ----------
    name : str
        Of the patch that it was found from.
    wall : (k,) int array
        Nodes on the wall; for a cylinder the whole wall, even if the patch covers only a part.
    region : (r,) int array
        Cells all of whose nodes are within a number of edges of the wall.
    direction : (3,) array or None
        Unit vector normal to the wanted layers: as the user specifies, else the axis that the rule
        of the patch states and the wall does not contradict, else that of the cylinder nearest to
        the wall. Its sign is arbitrary. None where the wall is no cylinder and nothing is
        specified.
    radius : float, mm
        Of the hole; 0 where the patch is no cylinder.
    dropped : bool
        Whether the wall goes round an axis that it is too rough to show.
    """

    name: str
    wall: IntArray
    region: IntArray
    direction: FloatArray | None
    radius: float = 0.0
    dropped: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "wall", read_only(self.wall, np.int64))
        object.__setattr__(self, "region", read_only(self.region, np.int64))
        if self.direction is not None:
            object.__setattr__(self, "direction", read_only(self.direction))


def joint_of(mesh: TetMesh, name: str, rings: int = 4, direction: ArrayLike | None = None) -> Joint:
    """Find the joint that a patch belongs to.

    Parameters
    ----------
    name : str
        Patch: the wall of a hole, or a part of it; or any other patch.
    rings : int, default 4
        Extent of its region in edges round the wall (Fang et al. 2024: 4).
    direction : (3,) array, optional
        Replaces the axis of the hole, and that which the rule of the patch states.
    """
    facets = mesh.patch(name)
    if not len(facets):
        raise InputError(f"joint '{name}' is an empty patch: name one that has facets")
    wall, radius, axis = np.unique(facets), 0.0, None
    if (cylinder := _cylinder(mesh, facets)) is not None:
        axis, centre, radius = cylinder
        wall = _whole_wall(mesh, wall, axis, centre, radius)
    elif (rough := _rough_cylinder(mesh, facets)) is not None:
        axis, radius = rough
    # Where the mesh was turned after its patches were named, the wall contradicts what they state.
    stated = mesh.axes.get(name)
    if stated is not None and (axis is None or abs(stated @ axis) > _AGREE):
        axis = stated * np.sign(stated[np.argmax(np.abs(stated))])
    if direction is not None:
        axis = np.asarray(direction, dtype=np.float64)
        if axis.shape != (3,) or not 0.0 < np.linalg.norm(axis) < np.inf:
            raise InputError(f"direction of joint '{name}' must be three numbers; got {direction}")
        axis = axis / np.linalg.norm(axis)
    dropped = axis is None and _normal_spread(mesh, facets)[0][1] >= 2.0 * _FLAT
    return Joint(name, wall, _cells_within(mesh, wall, rings), axis, radius, dropped)


def joints_of(
    stress: PartStress,
    names: Sequence[str] = (),
    rings: int = 4,
    directions: Mapping[str, ArrayLike] | None = None,
) -> tuple[Joint, ...]:
    """Find the joints of a part in the order of their names, each hole once.

    Names are of patches, by default all that are held or loaded; rings and directions as in
    `joint_of`.
    """
    names, directions = tuple(names) or stress.held_or_loaded, directions or {}
    for name in directions:
        if name not in names:
            raise InputError(
                f"directions names '{name}', which is no joint; the joints are: "
                f"{', '.join(names) or 'none'}"
            )
    joints: list[Joint] = []
    for name in names:
        joint = joint_of(stress.mesh, name, rings, directions.get(name))
        shared = [len(np.intersect1d(joint.wall, other.wall)) for other in joints]
        if not any(
            both > 0.5 * min(len(joint.wall), len(other.wall))
            for both, other in zip(shared, joints, strict=True)
        ):
            joints.append(joint)
    return tuple(joints)


def joining_pairs(joints: Sequence[Joint], stress: PartStress) -> list[tuple[int, int]] | None:
    """Pairs of a held and a loaded joint; None if it is not known which these are."""
    loaded = [set(np.unique(stress.mesh.patch(name)).tolist()) for name in stress.loaded]
    if not loaded:
        return None
    is_loaded = [any(len(nodes & set(j.wall.tolist())) for nodes in loaded) for j in joints]
    pairs = [
        (i, k)
        for i, flag in enumerate(is_loaded)
        for k, other in enumerate(is_loaded)
        if flag and not other
    ]
    return pairs or None


def _cylinder(mesh: TetMesh, facets: IntArray) -> tuple[FloatArray, FloatArray, float] | None:
    """Axis, a point on it and radius of the cylinder that facets lie on; None if there is none.

    The axis is normal to all normals; the circle is fitted to the nodes (Kasa, IEEE Trans. Instrum.
    Meas. 25 (1976) 8-14).
    """
    values, vectors = _normal_spread(mesh, facets)
    # For a plane the two smallest values vanish.
    if values[0] > _FLAT or values[1] < 2.0 * _FLAT:
        return None
    frame = vectors[:, ::-1].T
    nodes = np.unique(facets)
    x, y = (mesh.points[nodes] @ frame[:2].T).T
    system = np.stack([x, y, np.ones_like(x)], axis=1)
    a, b, c = np.linalg.lstsq(system, x**2 + y**2, rcond=None)[0]
    centre = 0.5 * np.array([a, b])
    square = c + centre @ centre
    if not square > 0.0:
        return None
    radius = float(np.sqrt(square))
    if np.abs(np.hypot(x - centre[0], y - centre[1]) - radius).max() > _ROUND * radius:
        return None
    axis = frame[2] * np.sign(frame[2][np.argmax(np.abs(frame[2]))])
    return axis, centre @ frame[:2], radius


def _normal_spread(mesh: TetMesh, facets: IntArray) -> tuple[FloatArray, FloatArray]:
    """Mean squares of the normals along three directions, ascending, and these as columns."""
    area, normal = mesh.facet_areas(facets)
    values, vectors = np.linalg.eigh((area / area.sum() * normal.T) @ normal)
    return values, vectors


def _rough_cylinder(mesh: TetMesh, facets: IntArray) -> tuple[FloatArray, float] | None:
    """Axis and radius of a wall of voxels, or one with other facets in it; None if there is none.

    The normals give a first axis. The circle is fitted again and again with less weight for nodes
    that lie off it (Tukey's, of four median distances), then the cylinder to those near it.
    """
    values, vectors = _normal_spread(mesh, facets)
    if values[0] > _ROUGH or values[1] < 2.0 * _FLAT:
        return None
    points = mesh.points[np.unique(facets)]
    origin = points.mean(axis=0)
    plane = (points - origin) @ vectors[:, 1:]
    weight = np.ones(len(plane))
    # Circle ``|x|^2 = 2 c . x + rest``, linear in its centre c and in rest = r^2 - |c|^2.
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)[:, None]
        system = np.column_stack([2.0 * plane, np.ones(len(plane))])
        *centre, rest = np.linalg.lstsq(root * system, root[:, 0] * (plane**2).sum(axis=1))[0]
        square = rest + float(np.dot(centre, centre))
        if not square > 0.0:
            return None
        radius = float(np.sqrt(square))
        off = np.abs(np.linalg.norm(plane - centre, axis=1) - radius)
        scale = max(float(np.median(off)), 1e-9 * radius)
        weight = np.maximum(1.0 - (off / (4.0 * scale)) ** 2, 0.0) ** 2
    if scale > _UNROUND * radius:
        return None
    through = origin + vectors[:, 1:] @ centre
    _, axes, radius = fitted_cylinder(points[weight > 0.0], through, vectors, radius)
    axis = axes[:, 0]
    return axis * np.sign(axis[np.argmax(np.abs(axis))]), radius


def _whole_wall(
    mesh: TetMesh, nodes: IntArray, axis: FloatArray, centre: FloatArray, radius: float
) -> IntArray:
    """Boundary nodes on the cylinder that are connected to the given nodes."""
    facets = mesh.boundary
    away = mesh.points - centre
    away = away - (away @ axis)[:, None] * axis
    near = np.abs(np.linalg.norm(away, axis=1) - radius) <= _ROUND * radius
    facets = facets[near[facets].all(axis=1)]
    _, normal = mesh.facet_areas(facets)
    facets = facets[np.abs(normal @ axis) < 0.3]
    n = len(mesh.points)
    piece = connected(facets[:, [[0, 1], [0, 2]]].reshape(-1, 2), n)
    on_wall = np.zeros(n, dtype=bool)
    on_wall[facets] = True
    on_wall &= np.isin(piece, piece[nodes])
    on_wall[nodes] = True
    return np.flatnonzero(on_wall)


def _cells_within(mesh: TetMesh, nodes: IntArray, rings: int) -> IntArray:
    """Cells all of whose corners are within a number of edges of the nodes."""
    corners, n = mesh.corners, len(mesh.points)
    reached = np.zeros(n, dtype=bool)
    reached[nodes] = True
    for _ in range(rings):
        touched = corners[reached[corners].any(axis=1)]
        reached[touched] = True
    return np.flatnonzero(reached[corners].all(axis=1))


# Stress lines between joints, traced once and shared by all that use the same stress.


_KNOWN = "_joint_lines"


class JointLines(NamedTuple):
    """Strongest stress of the cells, and the region where lines along it join joints."""

    strongest: Strongest
    region: CriticalRegion


def joint_lines(stress: PartStress, joints: Sequence[Joint], keep: Keep) -> JointLines:
    """Trace the lines of the strongest stress from every cell; the stress stores the result.

    Those to keep are as in `critical_region`.
    """
    known = vars(stress).setdefault(_KNOWN, {})
    key = (tuple(joint.name for joint in joints), keep)
    if key not in known:
        strongest = strongest_stress(stress.stress)
        walls, pairs = [joint.wall for joint in joints], joining_pairs(joints, stress)
        region = critical_region(stress.mesh, strongest.direction, walls, pairs, keep)
        known[key] = JointLines(strongest, region)
    lines: JointLines = known[key]
    return lines
