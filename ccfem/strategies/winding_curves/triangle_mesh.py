"""Triangles in space that curves can be inserted into."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class TriangleMesh:
    """Triangles of one piece of a layer."""

    points: FloatArray  # (n, 3), mm
    triangles: IntArray  # (t, 3)
    source: IntArray  # (t,): triangle of the layer that each lies on


@dataclass(frozen=True)
class EdgePath:
    """A curve over triangles, straight in each: from a point of the mesh across its edges."""

    # Points of the mesh.
    start: int
    end: int
    edges: IntArray  # (k, 2): edges crossed, in order
    share: FloatArray  # (k,) in (0, 1): position of the crossing: the share of the second end

    def points(self, mesh: TriangleMesh) -> FloatArray:
        """Return the points of the curve, (k + 2, 3), mm."""
        a, b = mesh.points[self.edges[:, 0]], mesh.points[self.edges[:, 1]]
        crossed = (1.0 - self.share)[:, None] * a + self.share[:, None] * b
        return np.concatenate([mesh.points[self.start, None], crossed, mesh.points[self.end, None]])


def insert(mesh: TriangleMesh, path: EdgePath) -> tuple[TriangleMesh, IntArray]:
    """Split triangles so that a curve runs along edges.

    Parameters
    ----------
    path : EdgePath
        Consecutive edges belong to one triangle, and no triangle is crossed twice.

    Returns
    -------
    mesh : TriangleMesh
        The points of the old one keep their numbers.
    curve : (k + 2,) int array
        Points of the curve in the new mesh.
    """
    first = len(mesh.points)
    new = first + np.arange(len(path.edges))
    middle = {tuple(sorted(edge)): int(p) for edge, p in zip(path.edges.tolist(), new, strict=True)}
    touched, pieces, source = [], [], []
    marked = np.zeros(first, dtype=bool)
    marked[path.edges] = True
    for t in np.flatnonzero(marked[mesh.triangles].sum(axis=1) >= 2).tolist():
        corners = mesh.triangles[t].tolist()
        cuts = [
            middle.get(tuple(sorted((corners[(i + 1) % 3], corners[(i + 2) % 3]))))
            for i in range(3)
        ]
        if not any(cut is not None for cut in cuts):
            continue
        touched.append(t)
        parts = _split(corners, cuts)
        pieces += parts
        source += [int(mesh.source[t])] * len(parts)
    kept = np.ones(len(mesh.triangles), dtype=bool)
    kept[touched] = False
    split = np.array(pieces, dtype=np.int64).reshape(-1, 3)
    return (
        TriangleMesh(
            np.concatenate([mesh.points, path.points(mesh)[1:-1]]),
            np.concatenate([mesh.triangles[kept], split]),
            np.concatenate([mesh.source[kept], np.array(source, dtype=np.int64)]),
        ),
        np.concatenate([[path.start], new, [path.end]]).astype(np.int64),
    )


def _split(corners: list[int], cuts: list[int | None]) -> list[list[int]]:
    """Split a triangle whose side opposite to corner i is cut at a point, or not cut."""
    number = sum(cut is not None for cut in cuts)
    if number == 1:
        i = next(k for k in range(3) if cuts[k] is not None)
        a, b, c = corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]
        p = cuts[i]
        assert p is not None
        return [[a, b, p], [a, p, c]]
    if number == 3:
        p, q, r = cuts
        assert p is not None
        assert q is not None
        assert r is not None
        a, b, c = corners
        return [[a, r, q], [r, b, p], [q, p, c], [p, q, r]]
    # The corner between the two sides that are cut.
    i = next(k for k in range(3) if cuts[k] is None)
    a, b, c = corners[i], corners[(i + 1) % 3], corners[(i + 2) % 3]
    # Side b-c is opposite to a and whole: cuts lie on c-a (opposite to b) and on a-b.
    q, r = cuts[(i + 1) % 3], cuts[(i + 2) % 3]
    assert q is not None
    assert r is not None
    return [[a, r, q], [r, b, c], [r, c, q]]
