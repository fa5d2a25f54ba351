"""Protocols of the bodies and problems that loads and supports act on, in space or in the plane."""

from collections.abc import Mapping
from typing import Protocol

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.cell_mesh import CellMesh
from ccfem.fem.elasticity.load_kinds import Load
from ccfem.fem.elasticity.support_kinds import AnySupport


class LoadedBody(Protocol):
    """A mesh whose boundary facets have areas and outward normals, so that loads act on it."""

    @property
    def points(self) -> FloatArray:
        """Nodes, (n, d), mm."""
        ...

    @property
    def cells(self) -> IntArray:
        """Nodes of each cell, (m, q)."""
        ...

    def patch(self, name: str) -> IntArray:
        """Facets of a named patch that can carry a load."""
        ...

    def facet_nodes(self, facets: IntArray) -> IntArray:
        """All nodes of facets: their corners, and the middles of their sides."""
        ...

    @property
    def boundary(self) -> IntArray:
        """Boundary facets by their corners, the part on their inner side."""
        ...

    def facet_areas(self, facets: IntArray) -> tuple[FloatArray, FloatArray]:
        """Areas, mm^2, and unit normals of facets."""
        ...


class SupportedProblem(Protocol):
    """A problem as seen by supports and loads."""

    @property
    def mesh(self) -> CellMesh:
        """The mesh that supports act on."""
        ...

    @property
    def body(self) -> LoadedBody:
        """The body that loads act on."""
        ...

    @property
    def supports(self) -> tuple[AnySupport, ...]:
        """The supports."""
        ...

    @property
    def loads(self) -> Mapping[str, tuple[Load, ...]]:
        """Loads of each load case by its name."""
        ...
