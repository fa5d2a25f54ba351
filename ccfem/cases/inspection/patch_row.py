"""What a patch is: how large, where, which way it faces, in how many pieces."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import facet_keys
from ccfem.geometry.measures import connected


@dataclass(frozen=True)
class PatchRow:
    """A patch.

    Attributes
    ----------
    area : float, mm^2
    centre : (3,) array, mm
        Of the area.
    normal : (3,) array
        Mean outward normal by area: of length 1 for a plane, 0 for a whole round wall.
    pieces : int
        That hang together through edges.
    carries : str
        Support and load cases on it, in words; empty for none.
    """

    name: str
    area: float
    centre: FloatArray
    normal: FloatArray
    facets: int
    pieces: int
    carries: str = ""

    def __post_init__(self) -> None:
        freeze(self, centre=float, normal=float)


def patch_rows(mesh: TetMesh, carries: dict[str, list[str]]) -> tuple[PatchRow, ...]:
    """Describe all patches of a mesh, those that carry something first."""
    rows = []
    for name in sorted(mesh.patches, key=lambda name: (name not in carries, name)):
        facets = mesh.patches[name]
        if not len(facets):
            continue
        area, normal = mesh.facet_areas(facets)
        total = float(area.sum())
        middle = mesh.points[facets[:, :3]].mean(axis=1)
        said = "; ".join(dict.fromkeys(carries.get(name, [])))
        rows.append(
            PatchRow(
                name,
                total,
                area @ middle / total,
                area @ normal / total,
                len(facets),
                _pieces(facets[:, :3]),
                said,
            )
        )
    return tuple(rows)


def _pieces(facets: IntArray) -> int:
    """Count the pieces of facets that share edges."""
    (key,) = facet_keys(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    pairs = np.stack([order[same], order[same + 1]], axis=1) // 3
    return len(np.unique(connected(pairs, len(facets))))
