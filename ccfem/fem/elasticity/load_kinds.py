"""Kinds of loads: on patches, at points, in the volume, and by moving supports."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ccfem.base.checks import ACCELERATION, FORCE, MASS_DENSITY, TRACTION, WARMTH, Range

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Force:
    """A total force, N, spread evenly over the area of a patch."""

    patch: str
    vector: Vector


@dataclass(frozen=True)
class Traction:
    """A traction, MPa, on a patch."""

    patch: str
    vector: Vector


@dataclass(frozen=True)
class Pressure:
    """A pressure, MPa, on a patch; positive pushes inward."""

    patch: str
    magnitude: float


@dataclass(frozen=True)
class Bearing:
    """A total force, N, on a cylindrical patch, as a pin presses it.

    The pressure acts along the facet normals and varies as the cosine of the angle to the force,
    on the half that the pin touches; it is scaled to the total force.
    """

    patch: str
    vector: Vector


@dataclass(frozen=True)
class PointForce:
    """A force, N, at the mesh node nearest to a point, mm, of the part."""

    point: Vector
    vector: Vector


@dataclass(frozen=True)
class BodyForce:
    """A force on every volume of the part, N/mm^3."""

    vector: Vector


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Temperature:
    """A change of temperature, K, of the whole part; its materials need an expansion."""

    change: float


@dataclass(frozen=True)
class Displacement:
    """A displacement, mm, of the supports on a patch in this load case.

    It replaces their own value in the components, or along the directions, that they hold.
    """

    patch: str
    vector: Vector


SurfaceLoad = Force | Traction | Pressure | Bearing | PointForce
Load = SurfaceLoad | BodyForce | Gravity | Temperature | Displacement


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
    if isinstance(load, Temperature):
        return (("change of temperature", load.change, WARMTH),)
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
    return (kind.point,) if hasattr(kind, "point") and not patches_of(kind) else ()


def patches_in_use(
    supports: tuple[Any, ...], loads: Mapping[str, tuple[Load, ...]]
) -> tuple[str, ...]:
    """Names of the patches that carry a support or a load, sorted."""
    kinds = [*supports, *(load for case in loads.values() for load in case)]
    return tuple(sorted({name for kind in kinds for name in patches_of(kind)}))
