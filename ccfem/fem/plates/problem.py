"""The boundary value problem of a thin plate in its plane."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief, read_only
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.load_kinds import Pressure, SurfaceLoad, patches_in_use
from ccfem.fem.elasticity.support_kinds import Support
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
            if not isinstance(load, Pressure) and load.vector[2] != 0.0:
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
