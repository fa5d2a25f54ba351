"""Rules that choose named patches of the boundary: plane, box, cylinder, nearest, group.

A rule is a value; called with a mesh it returns the boundary facets that it chooses. A rule that
chooses nothing is an error that names the nearest candidate.
"""

import re
from collections.abc import Mapping
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import FARTHEST, check_fields, check_number
from ccfem.base.errors import InputError
from ccfem.base.plain import plain_dataclass
from ccfem.geometry.facets import are_among

Vector = tuple[float, float, float]

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_ALONG = np.cos(np.pi / 4)
"""Cosine above which a facet's normal counts as along a direction."""
_SURFACE = 1e-3
"""Default tolerance of plane and cylinder, in diagonals of the part (pytetwild's envelope)."""


class Bounded(Protocol):
    """A mesh, or a surface that is to be meshed, as rules see it."""

    @property
    def points(self) -> FloatArray:
        """Nodes (n, 3), mm."""
        ...

    @property
    def patches(self) -> Mapping[str, IntArray]:
        """Patches by name."""
        ...

    @property
    def boundary(self) -> IntArray:
        """Boundary facets (b, 3), outward."""
        ...

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, (2, 3), mm."""
        ...

    def facet_areas(self, facets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas, mm^2, and unit normals of facets."""
        ...

    def with_patches(
        self, patches: Mapping[str, IntArray], axes: Mapping[str, FloatArray] = ...
    ) -> Self:
        """Return the same with more patches, and the axes of some of them."""
        ...


BoundedT = TypeVar("BoundedT", bound=Bounded)


class PatchRule(Protocol):
    """Chooses boundary facets of a mesh."""

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3), outward, k >= 1."""
        ...


@plain_dataclass
class Plane:
    """Boundary facets on a plane.

    Attributes
    ----------
    normal : str or tuple of 3 floats
        "x", "y", "z" (a minus in front turns it round) or a vector of any length.
    offset : float or str, mm
        The plane holds the points with ``point @ normal = offset`` (normal of length 1); "min"
        and "max" are the ends of the part along the normal.
    tolerance : float, mm, optional
        How far the nodes of a facet may lie from the plane; default 1e-3 of the part's diagonal.
    """

    normal: str | Vector
    offset: float | str
    tolerance: float | None = None

    def __post_init__(self) -> None:
        unit_vector(self.normal, "plane normal")
        check_fields(self, "tolerance", at_least=0.0, unit="mm")
        if isinstance(self.offset, str) and self.offset not in ("min", "max"):
            raise InputError(
                f"plane offset must be a number, 'min' or 'max'; got '{self.offset}': write one"
            )

    @classmethod
    def through(
        cls, point: Vector, normal: str | Vector, tolerance: float | None = None
    ) -> "Plane":
        """Plane through a point, mm."""
        offset = float(np.asarray(point, dtype=float) @ unit_vector(normal, "plane normal"))
        return cls(normal, offset, tolerance)

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) whose nodes lie on the plane."""
        normal = unit_vector(self.normal, "plane normal")
        height = mesh.points @ normal
        on_part = mesh.boundary.ravel()
        if self.offset == "min":
            offset = float(height[on_part].min())
        elif self.offset == "max":
            offset = float(height[on_part].max())
        else:
            offset = float(self.offset)
        missed = np.abs(height - offset)[mesh.boundary].max(axis=1)
        facing = np.abs(cosine := _normals(mesh) @ normal) > _ALONG
        if isinstance(self.offset, str):  # the end of the part faces outward: of a sheet one side
            facing &= (cosine > 0.0) == (self.offset == "max")
        tolerance = _default(self.tolerance, mesh)
        return _choose(mesh, missed, tolerance, facing, f"plane {self.normal} at {offset:g} mm")


@plain_dataclass
class Box:
    """Boundary facets with all their nodes in a box.

    Attributes
    ----------
    lower, upper : tuple of 3 floats, mm
        Opposite corners; infinite where the box has no end.
    normal : str or tuple of 3 floats, optional
        Only facets that face this way, within 45 degrees.
    """

    lower: Vector
    upper: Vector
    normal: str | Vector | None = None

    def __post_init__(self) -> None:
        if self.normal is not None:
            unit_vector(self.normal, "box normal")
        lower, upper = (
            _checked_vector(self.lower, "box lower"),
            _checked_vector(self.upper, "box upper"),
        )
        if not (lower <= upper).all():
            raise InputError(
                f"box lower must not exceed upper; got {self.lower} and {self.upper}: swap them"
            )

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) in the box."""
        beyond = np.maximum(np.array(self.lower) - mesh.points, mesh.points - np.array(self.upper))
        missed = np.maximum(beyond.max(axis=1), 0.0)[mesh.boundary].max(axis=1)
        wanted = np.ones(len(missed), dtype=bool)
        if self.normal is not None:
            wanted = _normals(mesh) @ unit_vector(self.normal, "box normal") > _ALONG
        tolerance = 1e-9 * _diagonal(mesh)
        return _choose(mesh, missed, tolerance, wanted, f"box {self.lower} to {self.upper}")


@plain_dataclass
class Cylinder:
    """The wall of a hole or a pin: not its flat ends.

    Attributes
    ----------
    point : tuple of 3 floats, mm
        A point on the axis, which goes through the whole part.
    axis : str or tuple of 3 floats
        Direction of the axis.
    radius : float, mm
        The nodes of a facet lie within `radius` + `tolerance` of the axis.
    tolerance : float, mm, optional
        Default 1e-3 of the part's diagonal.
    half : str or tuple of 3 floats, optional
        Keep only the facets whose centre lies on this side of the axis.
    """

    point: Vector
    axis: str | Vector
    radius: float
    tolerance: float | None = None
    half: str | Vector | None = None

    def __post_init__(self) -> None:
        _place(self.point, "cylinder point")
        axis = unit_vector(self.axis, "cylinder axis")
        check_fields(self, "tolerance", at_least=0.0, unit="mm")
        check_fields(self, "radius", above=0.0, unit="mm")
        if self.half is not None and abs(unit_vector(self.half, "cylinder half") @ axis) > 0.999:
            raise InputError(
                "cylinder half must be a direction across the axis; got one along it: turn it"
            )

    def __call__(self, mesh: Bounded) -> IntArray:
        """Facets (k, 3) of the cylinder's wall."""
        axis = unit_vector(self.axis, "cylinder axis")
        arm = mesh.points - np.array(self.point)
        arm = arm - np.outer(arm @ axis, axis)
        distance = np.linalg.norm(arm, axis=1)[mesh.boundary].max(axis=1)
        missed = np.maximum(distance - self.radius, 0.0)
        wall = np.abs(_normals(mesh) @ axis) < _ALONG
        if self.half is not None:
            side = unit_vector(self.half, "cylinder half")
            side = side - (side @ axis) * axis
            wall &= arm[mesh.boundary].mean(axis=1) @ side > 0.0
        label = f"cylinder round {self.point} along {self.axis}, radius {self.radius:g} mm"
        return _choose(mesh, missed, _default(self.tolerance, mesh), wall, label)


@plain_dataclass
class Nearest:
    """The boundary facets whose centres are nearest to a point.

    Attributes
    ----------
    point : tuple of 3 floats, mm
    count : int, optional
        How many facets; 1 when neither `count` nor `radius` is given.
    radius : float, mm, optional
        All facets with their centres within this distance.
    """

    point: Vector
    count: int | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        _place(self.point, "nearest point")
        if self.count is not None and self.radius is not None:
            raise InputError("nearest takes count or radius; got both: drop one")
        check_fields(self, "count", at_least=1)
        check_fields(self, "radius", above=0.0, unit="mm")

    def __call__(self, mesh: Bounded) -> IntArray:
        """Boundary facets (k, 3) nearest to the point."""
        distance = np.linalg.norm(_centres(mesh) - np.array(self.point), axis=1)
        if self.radius is None:
            order = np.argsort(distance, kind="stable")[: self.count or 1]
            return mesh.boundary[np.sort(order)]
        everywhere = np.ones(len(distance), dtype=bool)
        missed = np.maximum(distance - self.radius, 0.0)
        label = f"radius {self.radius:g} mm round {self.point}"
        return _choose(mesh, missed, 0.0, everywhere, label)


@plain_dataclass
class Group:
    """A patch that came with the file: a physical group, node set or surface of that name."""

    name: str

    def __call__(self, mesh: Bounded) -> IntArray:
        """Facets (k, 3) of the group."""
        if self.name not in mesh.patches:
            raise InputError(
                f"the mesh has no group '{self.name}'; it has: {_groups(mesh)}: name one of them "
                "or use another rule"
            )
        return mesh.patches[self.name]


def patches_from_rules(mesh: BoundedT, rules: Mapping[str, PatchRule]) -> BoundedT:
    """Name patches of a mesh by rules.

    Parameters
    ----------
    rules : mapping of patch name to rule

    Returns
    -------
    TetMesh
        The same mesh with these patches besides those it had, and the axes that rules state.

    Raises
    ------
    InputError
        When a rule chooses no facet; the message names the patch and the nearest candidate.
    """
    patches, axes = {}, {}
    for name, rule in rules.items():
        check_free(name)
        if getattr(rule, "axis", None) is not None:
            axes[name] = unit_vector(rule.axis, "axis")  # type: ignore[attr-defined]
        try:
            patches[name] = rule(mesh)
        except InputError as error:
            raise InputError(f"patch '{name}': {error}") from None
    return mesh.with_patches(patches, axes)


def match_boundary(mesh: Bounded, facets: IntArray) -> IntArray:
    """Find the boundary facets, outward, that have the nodes of `facets` (k, 3) in any order.

    Facets that are not on the boundary, and repeated ones, drop out; the order is that of
    `TetMesh.boundary`.
    """
    if not len(facets):
        return np.zeros((0, 3), dtype=np.int64)
    return mesh.boundary[are_among(mesh.boundary, facets)]


def unit_vector(value: str | ArrayLike, what: str) -> FloatArray:
    """Make a unit vector (3,) of "x", "-y", ... or of a vector that is not zero."""
    if isinstance(value, str):
        if value.removeprefix("-") not in _AXES:
            raise InputError(
                f"{what} must be 'x', 'y', 'z', one of them with a minus, or 3 numbers; got "
                f'\'{value}\': write "z", "-z" or [0, 0, 1]'
            )
        return (-1.0 if value.startswith("-") else 1.0) * np.array(_AXES[value.removeprefix("-")])
    vector = _checked_vector(value, what)
    largest = float(np.abs(vector).max())
    if not 0.0 < largest < np.inf:
        raise InputError(
            f"{what} must have a finite length above 0; got {value}: write [0, 0, 1] or so"
        )
    return np.asarray(vector / largest / np.linalg.norm(vector / largest))


def _checked_vector(value: ArrayLike, what: str) -> FloatArray:
    try:
        vector = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{what} must be 3 numbers; got {value!r}: write [x, y, z]") from None
    if vector.shape != (3,) or np.isnan(vector).any():
        raise InputError(f"{what} must be 3 numbers; got {value!r}: write [x, y, z]")
    return vector


def _place(value: ArrayLike, what: str) -> None:
    for coordinate in _checked_vector(value, what):
        check_number(what, float(coordinate), at_least=-FARTHEST, at_most=FARTHEST, unit="mm")


def _diagonal(mesh: Bounded) -> float:
    return float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))


def _default(tolerance: float | None, mesh: Bounded) -> float:
    return _SURFACE * _diagonal(mesh) if tolerance is None else tolerance


def _normals(mesh: Bounded) -> FloatArray:
    return mesh.facet_areas(mesh.boundary)[1]


def _centres(mesh: Bounded) -> FloatArray:
    return mesh.points[mesh.boundary].mean(axis=1)


def _groups(mesh: Bounded) -> str:
    return ", ".join(sorted(mesh.patches)) or "none"


def _choose(
    mesh: Bounded, missed: FloatArray, tolerance: float, wanted: BoolArray, label: str
) -> IntArray:
    """Facets among the `wanted` that miss the rule by no more than the tolerance, mm."""
    chosen = wanted & (missed <= tolerance)
    if chosen.any():
        return mesh.boundary[chosen]
    candidates = np.where(wanted, missed, np.inf) if wanted.any() else missed
    nearest = int(np.argmin(candidates))
    facing = "" if wanted.any() else " (none faces or lies the right way)"
    centre = ", ".join(f"{x:.4g}" for x in _centres(mesh)[nearest])
    raise InputError(
        f"{label} chooses no boundary facet{facing}; the nearest misses it by "
        f"{missed[nearest]:.3g} mm, its centre at ({centre}) mm; groups in the mesh: "
        f"{_groups(mesh)}: move the rule or widen it"
    )


# Names of the groups that hold the numbered faces of the surface that a mesh was made from.


_NAME = re.compile("face_([0-9]+)")


def face_name(number: int) -> str:
    """Name of the group of a face: ``face_1``, ``face_2``, ..."""
    return f"face_{number}"


def number_of_face(name: str) -> int | None:
    """Return the number of the face whose group has this name; None for another name."""
    match = _NAME.fullmatch(name)
    return None if match is None else int(match[1])


def check_free(name: str) -> None:
    """Raise for a patch that would have the name of a numbered face, and be taken for it."""
    if number_of_face(name) is not None:
        raise InputError(
            f"patch '{name}' has a name that is kept for the numbered faces of a surface: choose "
            "another"
        )
