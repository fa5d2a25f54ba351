"""What meshes in space and in the plane share: nodes, cells, their facets, and named patches."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only
from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.geometry.facets import paired

_NONE: Mapping[str, FloatArray] = MappingProxyType({})


@dataclass(frozen=True)
class CellMesh(ABC):
    """A mesh of d-dimensional cells, d = 2 or 3, with named patches of facets.

    Attributes
    ----------
    points : (n, d) array, mm
    cells : (m, q) int array
        Nodes of each cell.
    patches : mapping of name to int arrays
        Boundary facets by their corners.
    axes : mapping of name to (3,) arrays
        Axes of round patches where the rule of the patch states one: a rough wall does not show it.
    """

    points: FloatArray
    cells: IntArray
    patches: Mapping[str, IntArray] = field(default_factory=dict)
    axes: Mapping[str, FloatArray] = field(default_factory=dict)

    dimension: ClassVar[int]
    sizes: ClassVar[tuple[int, ...]]
    """Numbers of nodes that a cell may have."""
    kinds: ClassVar[str]
    """What such cells are called."""

    def __post_init__(self) -> None:
        freeze(self, points=float, cells=int, patches=int, axes=float)
        d, known = self.dimension, " or ".join(f"(m, {size})" for size in self.sizes)
        if self.points.ndim != 2 or self.points.shape[1] != d:
            raise InputError(
                f"mesh points must have shape (n, {d}); got {self.points.shape}: give "
                f"{', '.join('xyz'[:d])} a node"
            )
        if self.cells.ndim != 2 or self.cells.shape[1] not in self.sizes or not len(self.cells):
            raise InputError(
                f"mesh cells must have shape {known} with m >= 1; got {self.cells.shape}: give "
                f"{self.kinds}"
            )
        if self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise InputError(
                f"mesh cells must name nodes 0 to {len(self.points) - 1}; got "
                f"{self.cells.min()} to {self.cells.max()}: check the numbering of the file"
            )

    def __repr__(self) -> str:
        size = " x ".join(f"{side:.4g}" for side in np.ptp(self.bounds, axis=0))
        return (
            f"{type(self).__name__}: {len(self.points):,} nodes, {len(self.cells):,} cells of "
            f"{self.cells.shape[1]}, {size} mm, patches {', '.join(sorted(self.patches)) or 'none'}"
        )

    @property
    @abstractmethod
    def facets(self) -> IntArray:
        """Corners of the facets of all cells, cell by cell, outward."""

    @property
    def corners(self) -> IntArray:
        """Corner nodes of each cell."""
        return self.cells

    @cached_property
    def _pairing(self) -> tuple[IntArray, IntArray]:
        return paired(self.facets)

    @property
    def _facets_a_cell(self) -> int:
        return len(self.facets) // len(self.cells)

    @cached_property
    def boundary(self) -> IntArray:
        """Corners of the boundary facets, outward: the part is on their inner side."""
        return read_only(self.facets[self._pairing[1]], int)

    @cached_property
    def boundary_cells(self) -> IntArray:
        """Cell of each boundary facet, (b,)."""
        return read_only(self._pairing[1] // self._facets_a_cell, int)

    @cached_property
    def neighbours(self) -> IntArray:
        """Pairs of cells that share a facet, (f, 2)."""
        return read_only(self._pairing[0] // self._facets_a_cell, int)

    @cached_property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, (2, d), mm."""
        return read_only(np.stack([self.points.min(axis=0), self.points.max(axis=0)]))

    def facet_nodes(self, facets: IntArray) -> IntArray:
        """All nodes of facets: of linear cells their corners."""
        return facets

    def with_patches(
        self, patches: Mapping[str, IntArray], axes: Mapping[str, FloatArray] = _NONE
    ) -> Self:
        """Return the same mesh with more named patches, and the axes of some of them."""
        kept = {name: axis for name, axis in self.axes.items() if name not in patches}
        return replace(self, patches={**self.patches, **patches}, axes={**kept, **axes})

    def patch(self, name: str) -> IntArray:
        """Facets of a named patch.

        Raises
        ------
        InputError
            When there is no patch of that name; the known ones are listed.
        """
        check_known("patch", name, sorted(self.patches))
        return self.patches[name]
