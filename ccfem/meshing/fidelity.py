"""How well a mesh fills the surface that it was made from."""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import FloatArray, IntArray
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.io.surface import Surface
from ccfem.mesh.tet_mesh import TetMesh

__all__ = ["Fidelity", "fidelity"]

_VOLUME = 0.02
"""Share of the volume that may be lost or gained."""


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
            f"boundaries within {self.deviation:.3g} mm"
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
    """Farthest that queries (q, 3) lie from a surface, mm; its large triangles are cut first."""
    size = float(np.median(np.linalg.norm(np.ptp(points[triangles], axis=1), axis=1)))
    corners = points[triangles]
    for _ in range(12):
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        large = sides.max(axis=1) > 4.0 * size
        if not large.any() or len(corners) > 400_000:
            break
        corners = np.concatenate([corners[~large], _halved(corners[large], sides[large])])
    rows = np.arange(3 * len(corners)).reshape(-1, 3)
    found = nearest_on_triangles(corners.reshape(-1, 3), rows, queries)
    return float(found.distance.max())


def _halved(corners: FloatArray, sides: FloatArray) -> FloatArray:
    """Triangles (t, 3, 3) cut in two across their longest side; side k ends at corner k."""
    end = sides.argmax(axis=1)
    row = np.arange(len(corners))
    a, b, c = (corners[row, (end + k) % 3] for k in (0, 1, 2))  # the longest side joins c and a
    middle = 0.5 * (a + c)
    return np.concatenate([np.stack([a, b, middle], 1), np.stack([middle, b, c], 1)])
