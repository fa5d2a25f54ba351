"""Kinds of supports: patches, edges, points, rigid patches, pins, springs and elastic beds."""

from typing import Any, Literal

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import BED, SPRING, Range, check_number
from ccfem.base.errors import InputError
from ccfem.base.plain import plain_dataclass
from ccfem.body.mesh.patches import unit_vector
from ccfem.fem.elasticity.load_kinds import Vector

_ZERO = (0.0, 0.0, 0.0)
_UNIT = 1e-9
"""Deviation from unit vectors at right angles that is taken for rounding."""
_LARGEST_ANGLE = 25.0
"""Rotation, degrees, above which linear theory lengthens a part that turns by a tenth:
``sqrt(1 + angle^2)``."""


@plain_dataclass
class Support:
    """Components of the displacement held on a patch.

    Attributes
    ----------
    components : str, default "xyz"
        Which components are held.
    value : tuple of 3 floats, mm, default zero
        Displacement that the held components take.
    """

    patch: str
    components: str = "xyz"
    value: Vector = _ZERO

    def __post_init__(self) -> None:
        _check_components(self, self.components, f"patch '{self.patch}'")


@plain_dataclass
class EdgeSupport:
    """Components held at the edge where two patches meet, that is at their common nodes.

    Attributes
    ----------
    patches : tuple of 2 str
    components : str, default "xyz"
    value : tuple of 3 floats, mm, default zero
    """

    patches: tuple[str, str]
    components: str = "xyz"
    value: Vector = _ZERO

    def __post_init__(self) -> None:
        object.__setattr__(self, "patches", tuple(self.patches))
        if len(self.patches) != 2 or self.patches[0] == self.patches[1]:
            raise InputError(
                f"an edge support needs the names of two patches that meet; got {self.patches}: "
                "name two"
            )
        _check_components(self, self.components, f"patches {self.patches}")


@plain_dataclass
class PointSupport:
    """Components held at the mesh node nearest to a point, mm, of the part.

    Attributes
    ----------
    point : tuple of 3 floats, mm
    components : str, default "xyz"
    value : tuple of 3 floats, mm, default zero
    """

    point: Vector
    components: str = "xyz"
    value: Vector = _ZERO

    def __post_init__(self) -> None:
        _check_components(self, self.components, f"point {self.point}")
        _check_finite(self, "point")


@plain_dataclass
class NodeSupport:
    """Components held at the mesh nodes nearest to points, mm, of the part.

    Attributes
    ----------
    name : str
        What its force is called in results.
    points : tuple of tuples of 3 floats, mm
    components : str, default "xyz"
    value : tuple of 3 floats, mm, default zero
    axes : tuple of 3 tuples of 3 floats each, optional
        For each point the unit vectors that its components are along; default those of the space.
    """

    name: str
    points: tuple[Vector, ...]
    components: str = "xyz"
    value: Vector = _ZERO
    axes: tuple[tuple[Vector, Vector, Vector], ...] = ()

    def __post_init__(self) -> None:
        _check_components(self, self.components, f"nodes '{self.name}'")
        if not self.points:
            raise InputError(f"the support at nodes '{self.name}' has no point: give some")
        _check_finite(self, "points")
        if self.axes:
            axes = np.asarray(self.axes, dtype=np.float64)
            off = np.abs(np.einsum("kij,klj->kil", axes, axes) - np.eye(3)).max()
            if len(axes) != len(self.points) or not off <= _UNIT:
                raise InputError(
                    f"the axes of the support at nodes '{self.name}' must be three unit vectors at "
                    f"right angles a point; got {len(axes)} for {len(self.points)} points, off by "
                    f"up to {off:.2g}: correct them"
                )


@plain_dataclass
class LocalSupport:
    """Components along axes of its own held on a patch: of a turned or a cylindrical system.

    Attributes
    ----------
    points : tuple of 2 tuples of 3 floats, mm
        Of a rectangular system a vector along its x axis and one in its xy plane, both from the
        origin. Of a cylindrical one two points on its axis: x is then radial, y tangential, and z
        along the axis, from the first to the second.
    system : "rectangular" or "cylindrical", default "rectangular"
    components : str, default "xyz"
        Which components are held, along these axes.
    value : tuple of 3 floats, mm, default zero
        Displacement that the held components take, along these axes.
    """

    patch: str
    points: tuple[Vector, Vector]
    system: Literal["rectangular", "cylindrical"] = "rectangular"
    components: str = "xyz"
    value: Vector = _ZERO

    def __post_init__(self) -> None:
        _check_components(self, self.components, f"patch '{self.patch}'")
        if len(self.points) != 2:
            raise InputError(
                f"the axes of patch '{self.patch}' need two points; got {self.points}: give two"
            )
        _check_finite(self, "points", "value")
        local_axes(self.system, self.points, np.zeros((0, 3)))


def local_axes(system: str, points: Any, places: FloatArray) -> FloatArray:
    """Axes (k, 3, 3) as columns at places (k, 3) of a system of two points: see `LocalSupport`.

    Raises
    ------
    InputError
        Where the points show no axes, or a place lies on the axis of a cylindrical system.
    """
    first, second = np.asarray(points, dtype=np.float64)
    round_ = system == "cylindrical"
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused
        third = second - first if round_ else np.cross(first, second)
        size = np.linalg.norm(third)
        if not 0.0 < size < np.inf:
            given = [first.tolist(), second.tolist()]
            raise InputError(f"two points show no axes; got {given}: give others")
        third = np.tile(third / size, (len(places), 1))
        if round_:
            along = places - first
            far = np.linalg.norm(along, axis=1)
            along = along - np.einsum("ki,ki->k", along, third)[:, None] * third
        else:
            along, far = np.tile(first, (len(places), 1)), np.zeros(len(places))
        radius = np.linalg.norm(along, axis=1)
        if not ((radius > _UNIT * far) & (radius < np.inf)).all():
            raise InputError(
                "a place lies on the axis of a cylindrical system through "
                f"{tuple(first.tolist())}, where nothing is radial, or too far from it: leave it "
                "out, or move the axis"
            )
    along /= radius[:, None]
    return np.stack([along, np.cross(third, along), third], axis=2)


@plain_dataclass
class SlidingSupport:
    """A patch that slides without friction: only motion normal to its surface is held.

    Attributes
    ----------
    patch : str
        A plane of any orientation; on a curved patch each node slides on its own tangent plane,
        on a round wall that of the cylinder, so that it turns freely about its axis.
    normal : str or tuple of 3 floats, optional
        Direction that is held, of any length, or "x", "-z" ...; by default the outward normal of
        the patch.
    value : float, mm, default 0
        Displacement along that direction.
    """

    patch: str
    normal: str | Vector | None = None
    value: float = 0.0

    def __post_init__(self) -> None:
        _check_finite(self, "value")
        if self.normal is not None:
            unit_vector(self.normal, f"normal of the sliding support on patch '{self.patch}'")


@plain_dataclass
class PressingSupport:
    """A patch on something rigid, without friction: it may lift off, but not sink in.

    Examples are the wall of a bolt hole, the ring under a bolt head, and a table. There is no gap
    before loading, so the solution is proportional to the load. Two such patches may meet only at
    right angles. On quadratic cells the midpoints of the edges bear: under uniform pressure the
    corners carry nothing.

    Attributes
    ----------
    normal : str or tuple of 3 floats, optional
        Direction out of the part, towards the support, of any length, or "x", "-z" ...; by default
        the outward normal at each node.
    """

    patch: str
    normal: str | Vector | None = None

    def __post_init__(self) -> None:
        if self.normal is not None:
            unit_vector(self.normal, f"normal of the pressing support on patch '{self.patch}'")


@plain_dataclass
class RigidPatch:
    """A patch that moves as a rigid body, as if a stiff plate were glued to it.

    Attributes
    ----------
    components : str, default "xyz"
        Which components of the displacement of its centre are held; may be empty.
    rotations : str, default "xyz"
        About which axes through its centre its rotation is held; may be empty.
    value : tuple of 3 floats, mm, default zero
        Displacement that the held components take.
    angle : tuple of 3 floats, degrees, default zero
        Rotation that the held rotations take: small, at most 25.
    centre : tuple of 3 floats, mm, optional
        By default the centroid of the patch.
    """

    patch: str
    components: str = "xyz"
    rotations: str = "xyz"
    value: Vector = _ZERO
    angle: Vector = _ZERO
    centre: Vector | None = None

    def __post_init__(self) -> None:
        for letters in (self.components, self.rotations):
            if set(letters) - set("xyz"):
                raise InputError(
                    "components and rotations of a rigid patch must be letters of 'xyz', or empty; "
                    f"got '{letters}' on patch '{self.patch}'"
                )
        _check_finite(self, "value", "angle", "centre")
        if max(map(abs, self.angle)) > _LARGEST_ANGLE:
            raise InputError(
                f"a rigid patch must turn by at most {_LARGEST_ANGLE:g} degrees, for rotations are "
                f"linear and a larger one stretches it by a tenth; got {self.angle} on patch "
                f"'{self.patch}': turn it less, since stress is proportional to the angle"
            )


@plain_dataclass
class Pin:
    """A rigid pin glued into a hole, which turns freely about its own axis.

    Attributes
    ----------
    patch : str
        Wall of the hole.
    point : tuple of 3 floats, mm
        On the axis.
    axis : str or tuple of 3 floats
        Direction of the axis, of any length, or "x", "-z" ...
    slides : bool, default False
        Whether it is free to move along its axis too.
    value : tuple of 3 floats, mm, default zero
        Displacement of the pin.
    """

    patch: str
    point: Vector
    axis: str | Vector
    slides: bool = False
    value: Vector = _ZERO

    def __post_init__(self) -> None:
        _check_finite(self, "point", "value")
        unit_vector(self.axis, f"axis of the pin in patch '{self.patch}'")


@plain_dataclass
class TiedPatch:
    """A patch glued to another one, whose mesh is a different one: its nodes follow the other's.

    Attributes
    ----------
    patch : str
        Whose nodes follow: the finer mesh of the two.
    to : str
        The patch that they follow.
    within : float, mm, optional
        Nodes farther from it stay free; by default a twentieth of a mean side of its facets.
    """

    patch: str
    to: str
    within: float | None = None

    def __post_init__(self) -> None:
        if self.patch == self.to:
            raise InputError(f"patch '{self.patch}' is tied to itself: name two patches that touch")
        if self.within is not None:
            check_number(
                f"within of the tied patch '{self.patch}'", self.within, above=0.0, unit="mm"
            )

    @property
    def patches(self) -> tuple[str, str]:
        """Both patches."""
        return self.patch, self.to


@plain_dataclass
class Spring:
    """Springs to the ground, spread evenly over a patch.

    Attributes
    ----------
    stiffness : tuple of 3 floats, N/mm
        Of all of them together, along x, y and z; zero for none.
    """

    patch: str
    stiffness: Vector

    def __post_init__(self) -> None:
        _check_stiffness(self.stiffness, f"the spring on patch '{self.patch}'", SPRING)


@plain_dataclass
class PointSpring:
    """A spring to the ground at the mesh node nearest to a point, mm, of the part.

    Attributes
    ----------
    point : tuple of 3 floats, mm
    stiffness : tuple of 3 floats, N/mm
        Along x, y and z; zero for none.
    """

    point: Vector
    stiffness: Vector

    def __post_init__(self) -> None:
        _check_finite(self, "point")
        _check_stiffness(self.stiffness, f"the spring at {self.point}", SPRING)


@plain_dataclass
class Foundation:
    """An elastic bed under a patch (Winkler): traction proportional to displacement.

    It pulls as well as it presses. Where it should only press, check the sign of the reaction.

    Attributes
    ----------
    normal : float, MPa/mm
        Traction normal to the surface over normal displacement.
    tangential : float, MPa/mm, default 0
        The same along the surface.
    """

    patch: str
    normal: float
    tangential: float = 0.0

    def __post_init__(self) -> None:
        both = (self.normal, self.tangential)
        _check_stiffness(both, f"the foundation under patch '{self.patch}'", BED)


AnySupport = (
    Support
    | EdgeSupport
    | PointSupport
    | NodeSupport
    | LocalSupport
    | SlidingSupport
    | PressingSupport
    | RigidPatch
    | Pin
    | TiedPatch
    | Spring
    | PointSpring
    | Foundation
)


def _check_components(support: Any, components: str, where: str) -> None:
    if not components or set(components) - set("xyz"):
        raise InputError(
            f"support components must be letters of 'xyz'; got '{components}' on {where}"
        )


def _check_finite(support: Any, *names: str) -> None:
    for name in names:
        value = getattr(support, name)
        if value is not None and not np.isfinite(value).all():
            raise InputError(
                f"a support must be held at finite values; got {support}: give mm as numbers"
            )


def _check_stiffness(stiffness: tuple[float, ...], what: str, sizes: Range) -> None:
    if not np.isfinite(stiffness).all() or min(stiffness) < 0.0 or not any(stiffness):
        raise InputError(
            f"stiffness of {what} must be numbers of at least 0 {sizes.unit}, not all zero; got "
            f"{stiffness}: give one above 0, or drop the support"
        )
    for value in stiffness:
        sizes.check(f"stiffness of {what}", value)
