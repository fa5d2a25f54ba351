"""How well a mesh fills the surface that it was made from."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.files.surface import Surface
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles

_VOLUME = 0.02
"""Share of the volume that may be lost or gained."""
_FINEST = 0.001
"""Distance, mm, below which none is told from zero."""


@dataclass(frozen=True)
class Fidelity:
    """How a mesh differs from its surface.

    Attributes
    ----------
    volume : float
        Volume of the mesh less that of the surface, over the latter.
    deviation : float, mm
        Farthest that a node of one boundary lies from the other one.
    """

    volume: float
    deviation: float

    @property
    def good(self) -> bool:
        """Whether the volume is kept to 2 %."""
        return abs(self.volume) <= _VOLUME

    def about(self, mesher: str) -> str:
        """One line: who made the mesh, and how well it fits; with a cure where it does not."""
        word = "more" if self.volume > 0.0 else "less"
        text = (
            f"meshed by {mesher}: volume {abs(self.volume):.2%} {word} than the surface's, "
            f"boundaries within {max(self.deviation, _FINEST):.3g} mm"
        )
        return text if self.good else f"{text}: shorten edge_length to keep the shape"


def fidelity(surface: Surface, mesh: TetMesh) -> Fidelity:
    """Compare a mesh with the surface that it was made from."""
    shell = np.unique(mesh.boundary)
    out = _distance(surface.points, surface.triangles, mesh.points[shell])
    back = _distance(mesh.points, mesh.boundary, surface.points[np.unique(surface.triangles)])
    change = float(mesh.volumes.sum()) / surface.volume - 1.0
    return Fidelity(change, max(out, back))


def _distance(points: FloatArray, triangles: IntArray, queries: FloatArray) -> float:
    """Farthest that queries (q, 3) lie from a surface, mm."""
    return float(nearest_on_triangles(points, triangles, queries).distance.max())
