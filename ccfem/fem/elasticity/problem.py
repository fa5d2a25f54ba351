"""The boundary value problem: mesh, materials, supports, loads and their combinations."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.checks import check_known
from ccfem.base.display import Shown
from ccfem.base.errors import InputError
from ccfem.base.tensor import rotate_stiffness
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.load_kinds import (
    Bearing as Bearing,
    Force as Force,
    Load,
    PointForce as PointForce,
    Pressure as Pressure,
    Traction as Traction,
    patches_in_use,
    patches_of,
)
from ccfem.fem.elasticity.nodes import patch_facets
from ccfem.fem.elasticity.support_kinds import AnySupport, Support as Support
from ccfem.fem.materials import Material

Order = Literal["auto", 1, 2]

_ROTATION = 1e-6
"""Deviation from orthonormal axes that is taken for rounding."""
_SYMMETRIC = 1e-9
"""Deviation of a stiffness from a symmetric one, over its size, that is taken for rounding."""


@dataclass(frozen=True)
class Region:
    """Cells (k,) of another material than the rest of the part."""

    material: Material
    cells: IntArray

    def __post_init__(self) -> None:
        freeze(self, cells=int)


@dataclass(frozen=True)
class Problem(Shown):
    """A linear elastic part with its supports and loads, checked so that it can be solved.

    Attributes
    ----------
    material : Material
        Of all cells that no region names.
    supports : tuple of supports
        See `ccfem.fem.elasticity.support_kinds`.
    loads : mapping of load case name to tuple of loads
        See `ccfem.fem.elasticity.load_kinds`.
    axes : (m, 3, 3) array, optional
        Material axes of each cell as columns, the fibre first; default the global axes.
    density : (m,) array in (0, 1], optional
        Factor on the stiffness, and on the mass, of each cell; default 1.
    stiffness : (m, 6, 6) array, MPa, optional
        Stiffness of each cell in the global frame; overrides that of materials and `axes`.
    fill : (m,) array in (0, 1], optional
        Share of each cell that is material, a factor on its mass alone; default 1.
    strength : (m,) array in (0, 1], optional
        Strength of each cell over that of its material, in the mean over the cell; default 1.
    regions : tuple of Region
        Cells of other materials; no cell in two of them.
    combinations : mapping of name to mapping of load case name to factor
        Further load cases: sums of others, each times its factor. Factors apply to the loads: with
        supports that only press, displacements do not add up.
    order : "auto", 1 or 2, default "auto"
        Order of the displacement that `solve` takes on a mesh of linear cells: see
        `ccfem.fem.elasticity.plausibility`. Quadratic cells stay.
    case_supports : mapping of load case name to tuple of supports
        Supports that hold in that load case only, besides `supports`. Each set of supports is
        solved separately: see `ccfem.fem.elasticity.solve`.

    Raises
    ------
    InputError
        For a mesh that cannot be solved on, arrays that do not fit it or are physically impossible,
        patches that do not exist or are empty, and combinations of unknown cases.
    """

    mesh: TetMesh
    material: Material
    supports: tuple[AnySupport, ...]
    loads: Mapping[str, tuple[Load, ...]] = field(default_factory=dict)
    axes: FloatArray | None = None
    density: FloatArray | None = None
    stiffness: FloatArray | None = None
    fill: FloatArray | None = None
    strength: FloatArray | None = None
    regions: tuple[Region, ...] = ()
    combinations: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    order: Order = "auto"
    case_supports: Mapping[str, tuple[AnySupport, ...]] = field(default_factory=dict)

    def __repr__(self) -> str:
        return (
            f"Problem of {self.material.name} on {self.mesh!r}; {len(self.all_supports)} supports, "
            f"load cases {', '.join(self.loads) or 'none'}"
        )

    def __post_init__(self) -> None:
        freeze(self, supports=tuple, loads=tuple, regions=tuple, combinations=dict)
        freeze(self, case_supports=tuple)
        freeze(self, axes=float, density=float, stiffness=float, fill=float, strength=float)
        if self.mesh.flaw:
            raise InputError(self.mesh.flaw)
        self._check_arrays()
        self._check_regions()
        self._check_names()
        if self.order not in ("auto", 1, 2):
            raise InputError(
                f"order of the displacement must be 'auto', 1 or 2; got {self.order!r}: choose one"
            )

    def _check_arrays(self) -> None:
        m = len(self.mesh.cells)
        shares = ("density", "fill", "strength")
        shapes = {"axes": (m, 3, 3), "stiffness": (m, 6, 6), **dict.fromkeys(shares, (m,))}
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is None:
                continue
            if value.shape != shape:
                raise InputError(
                    f"problem.{name} must have shape {shape}, one entry a cell; got {value.shape}"
                )
            if not np.isfinite(value).all():
                raise InputError(f"problem.{name} must be finite; got NaN or infinity")
        for name in shares:
            value = getattr(self, name)
            if value is not None and not 0.0 < value.min() <= value.max() <= 1.0:
                raise InputError(
                    f"problem.{name} must lie in (0, 1]; got {value.min()} to {value.max()}: give "
                    f"void cells a small positive {name}"
                )
        if self.axes is not None:
            off = np.abs(np.einsum("mji,mjk->mik", self.axes, self.axes) - np.eye(3))
            off = off.max(axis=(1, 2))
            if off.max() > _ROTATION:
                raise InputError(
                    "problem.axes must be three unit vectors at right angles, as columns; those of "
                    f"cell {off.argmax()} are off by {off.max():.2g}: orthonormalise them"
                )
        if self.stiffness is not None:
            _check_stiffness(self.stiffness)

    def _check_regions(self) -> None:
        m = len(self.mesh.cells)
        seen = np.zeros(m, dtype=bool)
        for k, region in enumerate(self.regions):
            cells = region.cells
            if cells.ndim != 1 or not len(cells) or cells.min() < 0 or cells.max() >= m:
                raise InputError(
                    f"problem.regions[{k}] must name cells 0 to {m - 1}, at least one; got "
                    f"{cells.size} of them: number cells from 0, in one row"
                )
            if seen[cells].any() or len(np.unique(cells)) < len(cells):
                raise InputError(
                    f"problem.regions[{k}] names cells that another region has, or twice: give "
                    "each cell to one region"
                )
            seen[cells] = True

    def _check_names(self) -> None:
        loads = (load for case in self.loads.values() for load in case)
        for kind in (*self.all_supports, *loads):
            for name in patches_of(kind):
                patch_facets(self.mesh, name)
        for name in self.case_supports:
            check_known("load case", name, self.loads)
        for name, factors in self.combinations.items():
            unknown = sorted(set(factors) - set(self.loads))
            if name in self.loads or unknown or not factors:
                known = ", ".join(self.loads) or "none"
                cure = "rename it" if name in self.loads else f"give a factor to {known}"
                raise InputError(
                    f"combination '{name}' must have a name of its own and name load cases "
                    f"({known}); got {dict(factors)}: {cure}"
                )
            if not np.isfinite(list(factors.values())).all():
                raise InputError(f"factors of combination '{name}' must be finite; got {factors}")
            first, *others = factors
            for other in others:
                if self.supports_of(other) != self.supports_of(first):
                    raise InputError(
                        f"combination '{name}' adds up load cases '{first}' and '{other}', whose "
                        "supports differ: make it a load case with loads and supports of its own"
                    )

    @property
    def filled(self) -> float:
        """Share of the part's volume that is material."""
        volumes = self.mesh.volumes
        return 1.0 if self.fill is None else float(volumes @ self.fill / volumes.sum())

    def in_material(self, stress: FloatArray) -> FloatArray:
        """Mean stress (m, ...) of the cells, MPa, over the share of strength that they have."""
        if self.strength is None:
            return stress
        return np.asarray(stress / self.strength.reshape(-1, *(1,) * (stress.ndim - 1)))

    @property
    def body(self) -> TetMesh:
        """What loads act on: the mesh."""
        return self.mesh

    @property
    def held_or_loaded(self) -> tuple[str, ...]:
        """Names of the patches that carry a support or a load, sorted."""
        return patches_in_use(self.all_supports, self.loads)

    @property
    def all_supports(self) -> tuple[AnySupport, ...]:
        """Supports of all load cases, each once."""
        supports = list(self.supports)
        for of_case in self.case_supports.values():
            supports += [support for support in of_case if support not in supports]
        return tuple(supports)

    def supports_of(self, case: str) -> tuple[AnySupport, ...]:
        """Return the supports that hold in a load case, or in a combination of them."""
        return (*self.supports, *self.case_supports.get(next(iter(self.factors(case))), ()))

    @property
    def cases(self) -> tuple[str, ...]:
        """Names of the load cases, then of their combinations."""
        return (*self.loads, *self.combinations)

    def factors(self, case: str) -> Mapping[str, float]:
        """Load cases that one case consists of, with their factors."""
        return self.combinations.get(case, {case: 1.0})

    def loads_of(self, case: str) -> tuple[Load, ...]:
        """Return the loads of a case; of a combination those of all that it consists of."""
        return tuple(load for name in self.factors(case) for load in self.loads[name])

    @property
    def materials(self) -> tuple[tuple[Material, IntArray], ...]:
        """Each material with its cells (k,)."""
        rest = np.ones(len(self.mesh.cells), dtype=bool)
        for region in self.regions:
            rest[region.cells] = False
        materials = [(self.material, np.flatnonzero(rest))] if rest.any() else []
        return (*materials, *((region.material, region.cells) for region in self.regions))

    @property
    def cell_stiffness(self) -> FloatArray:
        """Stiffness in the global frame without density: (6, 6), or (m, 6, 6) per cell, MPa."""
        if self.stiffness is not None:
            return self.stiffness
        if not self.regions:
            stiffness = self.material.stiffness
        else:
            stiffness = np.empty((len(self.mesh.cells), 6, 6))
            for material, cells in self.materials:
                stiffness[cells] = material.stiffness
        return stiffness if self.axes is None else rotate_stiffness(stiffness, self.axes)


def _check_stiffness(stiffness: FloatArray) -> None:
    """Raise an error where a cell has a stiffness that no material can have."""
    size = np.abs(stiffness).max(axis=(1, 2))
    skew = np.abs(stiffness - np.swapaxes(stiffness, 1, 2)).max(axis=(1, 2))
    wrong = np.flatnonzero(skew > _SYMMETRIC * size)
    what = "symmetric: average it with its transpose"
    if not len(wrong):
        what = "positive definite: give void cells a small positive stiffness"
        try:
            np.linalg.cholesky(stiffness)
        except np.linalg.LinAlgError:
            wrong = np.flatnonzero(~(np.linalg.eigvalsh(stiffness)[:, 0] > 0.0))
    if len(wrong):
        raise InputError(
            f"problem.stiffness must be {what}; {len(wrong)} cells are not, the first is {wrong[0]}"
        )
