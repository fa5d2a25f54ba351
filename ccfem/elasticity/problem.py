"""The boundary value problem: mesh, material, supports and loads."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ccfem.arrays import FloatArray, freeze
from ccfem.errors import InputError
from ccfem.materials import Material
from ccfem.mesh.tet_mesh import TetMesh

__all__ = [
    "Bearing",
    "Force",
    "Load",
    "PointForce",
    "Pressure",
    "Problem",
    "Support",
    "Traction",
    "patches_in_use",
]


@dataclass(frozen=True)
class Support:
    """Components of the displacement held on a patch.

    Attributes
    ----------
    patch : str
    components : str, default "xyz"
        Which components are held.
    value : tuple of 3 floats, mm, default zero
        Displacement that the held components take.
    """

    patch: str
    components: str = "xyz"
    value: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not self.components or set(self.components) - set("xyz"):
            raise InputError(
                f"support components must be letters of 'xyz'; got '{self.components}' on "
                f"patch '{self.patch}'"
            )


@dataclass(frozen=True)
class Force:
    """A total force, N, spread evenly over the area of a patch."""

    patch: str
    vector: tuple[float, float, float]


@dataclass(frozen=True)
class Traction:
    """A traction, MPa, on a patch."""

    patch: str
    vector: tuple[float, float, float]


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
    vector: tuple[float, float, float]


@dataclass(frozen=True)
class PointForce:
    """A force, N, at the mesh node nearest to a point, mm."""

    point: tuple[float, float, float]
    vector: tuple[float, float, float]


Load = Force | Traction | Pressure | Bearing | PointForce


@dataclass(frozen=True)
class Problem:
    """A linear elastic part with its supports and loads.

    Attributes
    ----------
    mesh : TetMesh
    material : Material
        One material for the whole part.
    supports : tuple of Support
    loads : mapping of load case name to tuple of loads
    axes : (m, 3, 3) array, optional
        Material axes of each cell as columns, the fibre first; default the global axes.
    density : (m,) array in (0, 1], optional
        Factor on the stiffness of each cell; default 1.
    stiffness : (m, 6, 6) array, MPa, optional
        Stiffness of each cell in the global frame; overrides `material` and `axes`.
    """

    mesh: TetMesh
    material: Material
    supports: tuple[Support, ...]
    loads: Mapping[str, tuple[Load, ...]] = field(default_factory=dict)
    axes: FloatArray | None = None
    density: FloatArray | None = None
    stiffness: FloatArray | None = None

    def __repr__(self) -> str:
        return (
            f"Problem of {self.material.name} on {self.mesh!r}; {len(self.supports)} supports, "
            f"load cases {', '.join(self.loads) or 'none'}"
        )

    def __post_init__(self) -> None:
        freeze(self, supports=tuple, loads=tuple, axes=float, density=float, stiffness=float)
        m = len(self.mesh.cells)
        for name, shape in (("axes", (m, 3, 3)), ("density", (m,)), ("stiffness", (m, 6, 6))):
            value = getattr(self, name)
            if value is None:
                continue
            if value.shape != shape:
                raise InputError(
                    f"problem.{name} must have shape {shape}, one entry a cell; got {value.shape}"
                )
            if not np.isfinite(value).all():
                raise InputError(f"problem.{name} must be finite; got NaN or infinity")
        if self.density is not None and not 0.0 < self.density.min() <= self.density.max() <= 1.0:
            raise InputError(
                f"problem.density must lie in (0, 1]; got {self.density.min()} to "
                f"{self.density.max()}: give void cells a small positive density"
            )

    @property
    def body(self) -> TetMesh:
        """What loads act on: the mesh."""
        return self.mesh

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load, sorted."""
        return patches_in_use(self.supports, self.loads)


def patches_in_use(
    supports: tuple[Support, ...], loads: Mapping[str, tuple[Load, ...]]
) -> tuple[str, ...]:
    """Names of the patches that carry a support or a load, sorted."""
    names = {support.patch for support in supports}
    for case in loads.values():
        names |= {load.patch for load in case if not isinstance(load, PointForce)}
    return tuple(sorted(names))
