"""Kinds of loads: on patches, at points, in the volume, and by moving supports."""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from ccfem.base.checks import ACCELERATION, FORCE, MASS_DENSITY, MOMENT, TRACTION, WARMTH, Range
from ccfem.base.errors import InputError
from ccfem.base.formula import check_formula
from ccfem.base.plain import plain_dataclass

Vector = tuple[float, float, float]


@plain_dataclass
class Force:
    """A total force, N, spread evenly over the area of a patch."""

    patch: str
    vector: Vector


@plain_dataclass
class Traction:
    """A traction, MPa, on a patch."""

    patch: str
    vector: Vector


@plain_dataclass
class Pressure:
    """A pressure, MPa, on a patch; positive pushes inward."""

    patch: str
    magnitude: float


@plain_dataclass
class Bearing:
    """A total force, N, on a cylindrical patch, as a pin presses it.

    The pressure acts along the facet normals and varies as the cosine of the angle to the force,
    on the half that the pin touches; it is scaled to the total force.
    """

    patch: str
    vector: Vector


@plain_dataclass
class Moment:
    """A total moment, N mm, spread over a patch by tractions without a resultant force.

    The tractions are those that a rigid plate on a soft bed passes on: each is at right angles to
    the arm from the centroid of the patch and grows with it.
    """

    patch: str
    vector: Vector


@plain_dataclass
class PointForce:
    """A force, N, at the mesh node nearest to a point, mm, of the part."""

    point: Vector
    vector: Vector


@plain_dataclass
class NodeForces:
    """Forces, N, at the mesh nodes nearest to points, mm, of the part.

    Attributes
    ----------
    points, vectors : tuple of tuples of 3 floats
        A point, mm, and its force, N.
    """

    points: tuple[Vector, ...]
    vectors: tuple[Vector, ...]

    def __post_init__(self) -> None:
        if len(self.points) != len(self.vectors) or not self.points:
            raise InputError(
                f"forces at nodes need points and as many vectors; got {len(self.points)} and "
                f"{len(self.vectors)}: give a vector a point"
            )


@plain_dataclass
class BodyForce:
    """A force on every volume of the part, N/mm^3."""

    vector: Vector


@plain_dataclass
class Gravity:
    """The weight of the part, or the inertia force of an acceleration.

    Attributes
    ----------
    acceleration : tuple of 3 floats, m/s^2, default (0, 0, -9.81)
        Direction in which the weight pulls.
    mass_density : float, g/cm^3, optional
        Of the whole part; by default each material's own.
    """

    acceleration: Vector = (0.0, 0.0, -9.81)
    mass_density: float | None = None


@plain_dataclass
class Centrifugal:
    """The inertia forces of a part that turns steadily about an axis.

    Attributes
    ----------
    speed : float, rad/s
    point : tuple of 3 floats, mm
        On the axis.
    axis : tuple of 3 floats
        Its direction, of any length.
    mass_density : float, g/cm^3, optional
        Of the whole part; by default each material's own.
    """

    speed: float
    point: Vector
    axis: Vector
    mass_density: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < np.linalg.norm(self.axis) < np.inf:
            raise InputError(
                f"the axis of a centrifugal load must have a length; got {self.axis}: give its "
                "direction, as [0, 0, 1]"
            )


@plain_dataclass
class Temperature:
    """A change of temperature, K, of the part; its materials need an expansion.

    Attributes
    ----------
    change : float, str or tuple of floats, K
        Of the whole part; or a formula in x, y and z, mm (`ccfem.base.formula`); or the change at
        each of some points, between which it is linear (outside them that of the nearest counts).
    points : tuple of tuples of 3 floats, mm
        These points; none for the other two.
    """

    change: float | str | tuple[float, ...]
    points: tuple[Vector, ...] = ()

    def __post_init__(self) -> None:
        if isinstance(self.change, str):
            check_formula(self.change)
        count = len(self.change) if isinstance(self.change, tuple) else 0
        if count != len(self.points) or self.change == ():
            raise InputError(
                "a temperature has one change or formula, or a list of changes with a point each; "
                f"got {count} changes in a list and {len(self.points)} points: give a point a "
                "change"
            )


@plain_dataclass
class Displacement:
    """A displacement, mm, of the supports on a patch in this load case.

    It replaces their own value in the components, or along the directions, that they hold.
    """

    patch: str
    vector: Vector


SurfaceLoad = Force | Traction | Pressure | Bearing | Moment | PointForce | NodeForces
VolumeLoad = BodyForce | Gravity | Centrifugal
Load = SurfaceLoad | VolumeLoad | Temperature | Displacement


def kind_of(value: object) -> str:
    """Kind of a load or a support in words, as "point force"."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(value).__name__).lower()


def in_words(load: Load) -> str:
    """Name a load by its kind and patch, as "force on foot"."""
    return " on ".join((kind_of(load), *patches_of(load)))


def sizes_of(load: Load) -> tuple[tuple[str, float, Range], ...]:
    """Each size of a load: what it is, its value, and the range that it should have."""
    if isinstance(load, Gravity):
        weight = [("acceleration of gravity", max(load.acceleration, key=abs), ACCELERATION)]
        if load.mass_density is not None:
            weight.append(("mass density of gravity", load.mass_density, MASS_DENSITY))
        return tuple(weight)
    if isinstance(load, Centrifugal) and load.mass_density is not None:
        return (("mass density of the centrifugal load", load.mass_density, MASS_DENSITY),)
    if isinstance(load, Temperature):
        if isinstance(load.change, str):
            return ()
        return (("change of temperature", float(max(np.ravel(load.change), key=abs)), WARMTH),)
    if isinstance(load, NodeForces):
        return ((in_words(load), float(max(np.ravel(load.vectors), key=abs)), FORCE),)
    if isinstance(load, Moment):
        return ((in_words(load), max(load.vector, key=abs), MOMENT),)
    if isinstance(load, Pressure):
        return ((in_words(load), load.magnitude, TRACTION),)
    if isinstance(load, Force | Bearing | PointForce | Traction):
        sizes = TRACTION if isinstance(load, Traction) else FORCE
        return ((in_words(load), max(load.vector, key=abs), sizes),)
    return ()


def patches_of(kind: Any) -> tuple[str, ...]:
    """Names of the patches that a load or a support acts on."""
    if hasattr(kind, "patches"):
        return tuple(kind.patches)
    return (kind.patch,) if hasattr(kind, "patch") else ()


def points_of(kind: Any) -> tuple[Vector, ...]:
    """Points that a load or a support acts at, by their own coordinates."""
    if isinstance(kind, Temperature | Centrifugal) or patches_of(kind):
        return ()
    if hasattr(kind, "points"):
        return tuple(kind.points)
    return (kind.point,) if hasattr(kind, "point") else ()


def patches_in_use(
    supports: tuple[Any, ...], loads: Mapping[str, tuple[Load, ...]]
) -> tuple[str, ...]:
    """Names of the patches that carry a support or a load, sorted."""
    kinds = [*supports, *(load for case in loads.values() for load in case)]
    return tuple(sorted({name for kind in kinds for name in patches_of(kind)}))
