"""The boundary value problem of a thin plate in its plane."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, freeze, in_brief, read_only
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import Pressure, Support
from ccfem.fem.elasticity.load_kinds import NodeForces, SurfaceLoad, patches_in_use
from ccfem.fem.plates.mesh import PlaneMesh, Sheet


@dataclass(frozen=True)
class PlaneProblem:
    """A linear elastic plate in plane stress with its supports and loads.

    Attributes
    ----------
    stiffness : (m, 3, 3) array, MPa
        Of each cell in the global axes, ``[s11, s22, s12] = Q @ [e11, e22, 2 e12]``; one (3, 3)
        matrix stands for all cells. See `rotate_plane` and `stack_plane`.
    thickness : (m,) array, mm
        A float stands for all cells.
    supports : tuple of Support
        Their component z has no effect.
    loads : mapping of load case name to tuple of loads
        With no component z.
    """

    mesh: PlaneMesh
    stiffness: FloatArray
    thickness: FloatArray | float
    supports: tuple[Support, ...]
    loads: Mapping[str, tuple[SurfaceLoad, ...]] = field(default_factory=dict)

    __repr__ = in_brief

    def __post_init__(self) -> None:
        m = len(self.mesh.cells)
        freeze(self, supports=tuple, loads=tuple)
        stiffness, thickness = np.asarray(self.stiffness), np.asarray(self.thickness)
        if stiffness.shape not in ((3, 3), (m, 3, 3)):
            raise InputError(
                f"plane stiffness must have shape (3, 3) or ({m}, 3, 3); got {stiffness.shape}: "
                "give one matrix a cell"
            )
        if thickness.shape not in ((), (m,)) or not (thickness > 0.0).all():
            raise InputError(
                f"plane thickness must be positive, one for all or one a cell ({m}); got shape "
                f"{thickness.shape}, least {thickness.min() if thickness.size else 'none'} mm"
            )
        if not np.isfinite(stiffness).all() or not np.isfinite(thickness).all():
            raise InputError("plane stiffness and thickness must be finite; got NaN or infinity")
        broad = np.broadcast_to(stiffness, (m, 3, 3))
        object.__setattr__(self, "stiffness", read_only(broad))
        object.__setattr__(self, "thickness", read_only(np.broadcast_to(thickness, (m,))))
        for kind in (*self.supports, *(load for case in self.loads.values() for load in case)):
            if not isinstance(kind, Support | SurfaceLoad):
                raise InputError(
                    "a plane problem takes supports of patches and loads on its edges; got "
                    f"{kind}: model the part in space"
                )
        for support in self.supports:
            if not set(support.components) & set("xy") or support.value[2] != 0.0:
                raise InputError(
                    f"a plane problem knows x and y only; got {support}: hold x or y, with value "
                    "z zero"
                )
        for load in (load for case in self.loads.values() for load in case):
            if isinstance(load, Pressure):
                continue
            vectors = load.vectors if isinstance(load, NodeForces) else (load.vector,)
            if any(vector[2] != 0.0 for vector in vectors):
                raise InputError(
                    f"a plane problem is loaded in its plane; got {load}: give component z zero"
                )

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load, sorted."""
        return patches_in_use(self.supports, self.loads)

    @cached_property
    def volumes(self) -> FloatArray:
        """Volume of each cell, (m,), mm^3."""
        return read_only(self.mesh.areas * self.thickness)

    @cached_property
    def body(self) -> Sheet:
        """What loads act on: the mesh with its thickness."""
        return Sheet(self.mesh, np.asarray(self.thickness))


# Stiffness of fibre layers in the plane: turned, and stacked.


def _stress_matrix(angle: ArrayLike) -> FloatArray:
    """T (..., 3, 3) with ``stress_global = T @ stress_local`` for axes turned by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    rows = [[c * c, s * s, -2 * c * s], [s * s, c * c, 2 * c * s], [c * s, -c * s, c * c - s * s]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rotate_plane(stiffness: FloatArray, angle: ArrayLike) -> FloatArray:
    """Turn plane stiffness from material axes to the global ones.

    Parameters
    ----------
    stiffness : (3, 3) or (..., 3, 3) array, MPa
        In material axes, as from `ccfem.fem.materials.plane_stress`.
    angle : (...,) array, radians
        From global axis x to the fibre, counter-clockwise.

    Returns
    -------
    (..., 3, 3) array, MPa
        ``T Q T^T`` (Jones, Mechanics of Composite Materials, 1999, eq. 2.84).
    """
    turn = _stress_matrix(angle)
    return turn @ stiffness @ np.swapaxes(turn, -1, -2)


def fitted_harmonics(turned: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Five matrices (5, k, k) that `turned_by` combines to a stiffness turned about z.

    `turned` gives the stiffness (a, k, k) at angles (a,), radians.
    """
    angles = np.asarray(np.arange(5) * np.pi / 5.0, dtype=np.float64)
    return np.tensordot(np.linalg.inv(turned_by(angles)), turned(angles), axes=1)


def turned_by(angle: FloatArray, derivative: bool = False) -> FloatArray:
    """Factors (..., 5) of `fitted_harmonics` at an angle (...,), radians, or their derivatives."""
    two, four = 2.0 * angle, 4.0 * angle
    if derivative:
        parts = [0.0 * two, -2 * np.sin(two), 2 * np.cos(two), -4 * np.sin(four), 4 * np.cos(four)]
    else:
        parts = [1.0 + 0.0 * two, np.cos(two), np.sin(two), np.cos(four), np.sin(four)]
    return np.stack(parts, axis=-1)


def stack_plane(layers: FloatArray, thickness: ArrayLike | None = None) -> FloatArray:
    """Stiffness of layers that share the strain in their plane.

    Parameters
    ----------
    layers : (L, ..., 3, 3) array, MPa
        Of each layer in the global axes.
    thickness : (L,) array, optional
        Of each layer, in any unit; default equal.

    Returns
    -------
    (..., 3, 3) array, MPa
        The mean weighted by thickness: ``A / h`` of classical lamination theory (Jones, eq. 4.24).
    """
    layers = np.asarray(layers, dtype=np.float64)
    weights = np.ones(len(layers)) if thickness is None else np.asarray(thickness, dtype=np.float64)
    if weights.shape != (len(layers),) or not (weights > 0.0).all():
        raise InputError(
            f"thickness must be {len(layers)} positive numbers, one a layer; got {thickness!r}"
        )
    return np.tensordot(weights / weights.sum(), layers, axes=1)


def stress_in_axes(stress: FloatArray, angle: ArrayLike) -> FloatArray:
    """Components of plane stress (..., 3), MPa, in axes turned by an angle (...,), radians."""
    return np.einsum("...ij,...j->...i", _stress_matrix(-np.asarray(angle)), stress)


def strain_in_axes(strain: FloatArray, angle: ArrayLike) -> FloatArray:
    """Components of plane strain (..., 3), engineering shear, in axes turned by an angle."""
    turn = np.swapaxes(_stress_matrix(np.asarray(angle)), -1, -2)
    return np.einsum("...ij,...j->...i", turn, strain)
