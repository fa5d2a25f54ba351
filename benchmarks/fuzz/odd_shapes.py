"""Odd meshes and surfaces, by name: what no mesher should make, and what people send."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay

from ccfem.body.mesh import box_mesh

__all__ = ["odd_grids", "odd_shells"]

Shape = tuple[str, NDArray[np.float64], NDArray[np.int64]]

TET = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
ONE = np.array([[0, 1, 2, 3]])


def odd_grids() -> Iterator[Shape]:
    """Tetrahedra: name, points (n, 3), cells (m, 4) or (m, 10)."""
    yield from _single()
    yield from _pairs()
    yield from _spoiled_boxes()
    yield from _bent_boxes()
    yield from _clouds()


def _single() -> Iterator[Shape]:
    yield "one tet", TET, ONE
    yield "one tet inside out", TET, ONE[:, [1, 0, 2, 3]]
    for size in (1e-300, 1e-12, 1e-6, 1e6, 1e8, 1e12, 1e100, 1e300):
        yield f"one tet of size {size:g}", TET * (size / 10.0), ONE
    for height in (0.0, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3):
        yield f"one tet of height {height:g}", TET * [1, 1, height], ONE
    for length in (1e2, 1e5, 1e8):
        yield f"needle of aspect {length:g}", TET * [length, 1, 1], ONE
    for far in (1e6, 1e8, 1e12, 1e16):
        yield f"one tet {far:g} mm away", TET + far, ONE
    yield "four equal corners", TET * 0.0, ONE
    yield "corners on a line", np.outer(np.arange(4.0), [1, 2, 3]), ONE
    yield "a corner named twice", TET, np.array([[0, 1, 2, 2]])
    yield "a cell of one node", TET, np.zeros((1, 4), dtype=int)
    yield "no cells", TET, np.zeros((0, 4), dtype=int)
    yield "no points", np.zeros((0, 3)), ONE
    yield "a node below the first", TET, np.array([[0, 1, 2, -1]])
    yield "a node beyond the last", TET, np.array([[0, 1, 2, 4]])
    yield "a node far beyond the last", TET, np.array([[0, 1, 2, 2**62]])


def _pairs() -> Iterator[Shape]:
    above = np.concatenate([TET, [[0, 0, -10.0]]])
    yield "two tets on one face", above, np.array([[0, 1, 2, 3], [0, 2, 1, 4]])
    yield "the same tet twice", TET, np.repeat(ONE, 2, axis=0)
    yield "a tet and itself inside out", TET, np.array([[0, 1, 2, 3], [1, 0, 2, 3]])
    yield (
        "two tets on one side of a face",
        np.concatenate([TET, [[1, 1, 5.0]]]),
        np.array([[0, 1, 2, 3], [0, 1, 2, 4]]),
    )
    yield (
        "three tets on one face",
        np.concatenate([above, [[1, 1, -5.0]]]),
        np.array([[0, 1, 2, 3], [0, 2, 1, 4], [0, 2, 1, 5]]),
    )
    edge = np.concatenate([TET, [[0, -10, 0], [0, 0, -10.0]]])
    yield "two tets on one edge", edge, np.array([[0, 1, 2, 3], [0, 1, 4, 5]])
    node = np.concatenate([TET, -TET[1:]])
    yield "two tets on one node", node, np.array([[0, 1, 2, 3], [0, 5, 4, 6]])
    twice = np.array([[0, 1, 2, 3], [4, 5, 6, 7]])
    for gap in (0.0, 1e-12, 1e-6, 1.0, 1e6):
        other = np.concatenate([TET, TET * [1, 1, -1] - [0, 0, gap]])
        yield f"two tets {gap:g} mm apart", other, twice[:, [0, 1, 2, 3]]
    yield "two tets in one place", np.concatenate([TET, TET]), twice
    yield "a tet in a tet", np.concatenate([TET, 0.2 * TET + 1.0]), twice
    for count in (3, 100):
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
        rim = np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        k = np.arange(count)
        cells = np.stack([0 * k, 0 * k + 1, k + 2, (k + 1) % count + 2], axis=1)
        yield f"{count} tets round an edge", np.concatenate([[[0, 0, -1], [0, 0, 1]], rim]), cells


def _box() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    mesh = box_mesh((20.0, 10.0, 5.0), (4, 2, 2))
    return np.array(mesh.points), np.array(mesh.cells)


def _spoiled_boxes() -> Iterator[Shape]:
    points, cells = _box()
    turned = cells[:, [1, 0, 2, 3]]
    yield "box inside out", points, turned
    yield "box half inside out", points, np.concatenate([cells[::2], turned[1::2]])
    yield "box of cells twice", points, np.concatenate([cells, cells])
    yield (
        "box of cells on their own",
        points[cells].reshape(-1, 3),
        np.arange(cells.size).reshape(-1, 4),
    )
    yield "box with nodes of no cell", np.concatenate([points, points + 100.0]), cells
    for word, value in (("NaN", np.nan), ("infinity", np.inf), ("1e200", 1e200)):
        spoiled = points.copy()
        spoiled[7, 1] = value
        yield f"box with {word}", spoiled, cells
    yield "NaN in a node of no cell", np.concatenate([points, [[np.nan] * 3]]), cells
    inner = np.flatnonzero((points > points.min(0)).all(1) & (points < points.max(0)).all(1))
    hollow = ~np.isin(cells, inner[:1]).any(axis=1)
    yield "box with a cavity", points, cells[hollow]
    for seed in range(5):
        kept = np.random.default_rng(seed).random(len(cells)) < 0.6
        yield f"box with cells missing, {seed}", points, cells[kept]
    for amount in (0.1, 1.0, 3.0, 10.0, 100.0):
        noise = np.random.default_rng(1).normal(size=points.shape)
        yield f"box shaken by {amount:g} mm", points + amount * noise, cells
    order = np.random.default_rng(2).permutation(len(points))
    yield "box with its nodes mixed up", points[order], cells
    middle = points[cells].mean(axis=1)
    where = (middle // 5.0).astype(int).sum(axis=1) % 2 == 0
    yield "cubes that touch at edges", points, cells[where]
    other = np.concatenate([points, points + np.array([20.0, 10.0, 5.0])])
    yield "boxes that touch at a corner", other, np.concatenate([cells, cells + len(points)])
    fine = box_mesh((20.0, 10.0, 5.0), (7, 3, 3))
    both = np.concatenate([points, fine.points + np.array([20.0, 0, 0])])
    yield "boxes whose nodes do not meet", both, np.concatenate([cells, fine.cells + len(points)])
    many = np.concatenate([points + np.array([30.0 * k, 0, 0]) for k in range(50)])
    pieces = np.concatenate([cells + k * len(points) for k in range(50)])
    yield "fifty boxes", many, pieces
    mesh = box_mesh((20.0, 10.0, 5.0), (4, 2, 2)).quadratic()
    curved = np.array(mesh.points)
    curved[len(points) :] += 0.5 * np.sin(curved[len(points) :])
    yield "quadratic box with curved sides", curved, np.array(mesh.cells)
    wild = np.array(mesh.points)
    wild[len(points) :] = 1e3 * np.random.default_rng(3).normal(size=wild[len(points) :].shape)
    yield "quadratic box with wild sides", wild, np.array(mesh.cells)
    wild[-1] = np.nan
    yield "quadratic box with NaN on a side", wild, np.array(mesh.cells)
    mixed = np.array(mesh.cells)
    mixed[:, 4:] = mixed[:, 9:3:-1]
    yield "quadratic box with its sides mixed up", np.array(mesh.points), mixed


def _bent_boxes() -> Iterator[Shape]:
    points, cells = _box()
    for height in (0.0, 1e-15, 1e-9, 1e-4, 1e6):
        yield f"box {height:g} times as high", points * [1, 1, height], cells
    for size in (1e-200, 1e-9, 1e9, 1e30):
        yield f"box {size:g} times as large", points * size, cells
    yield "box folded on itself", np.abs(points - [10, 0, 0]), cells
    yield "box in single precision far away", (points + 1e7).astype(np.float32).astype(float), cells
    mesh = box_mesh((60.0, 10.0, 2.0), (24, 4, 1))
    turn = mesh.points[:, 0] / 60.0 * 2.0 * np.pi
    for word, twist, turns in (("ring", 0.0, 1.0), ("Moebius strip", 0.5, 1.0), ("coil", 0, 2.0)):
        y, z = mesh.points[:, 1] - 5.0, mesh.points[:, 2] - 1.0
        across = np.cos(twist * turn) * y - np.sin(twist * turn) * z
        up = np.sin(twist * turn) * y + np.cos(twist * turn) * z
        radius = 20.0 + across
        at = np.stack([radius * np.cos(turns * turn), radius * np.sin(turns * turn), up], axis=1)
        yield f"{word}, its ends not joined", at, np.array(mesh.cells)
        spots, place = np.unique(np.round(at, 6), axis=0, return_inverse=True)
        yield f"{word}, its ends joined", spots, place.reshape(-1)[mesh.cells]


def _clouds() -> Iterator[Shape]:
    for seed in range(3):
        random = np.random.default_rng(seed)
        points = 20.0 * random.random((60, 3))
        yield f"Delaunay cells of a cloud, {seed}", points, Delaunay(points).simplices
        yield f"cells at random, {seed}", points, random.integers(0, 60, (80, 4))
    grid = np.stack(np.meshgrid(*[np.arange(4.0)] * 3), axis=-1).reshape(-1, 3)
    yield "Delaunay cells of a grid", grid, Delaunay(grid, qhull_options="QJ").simplices
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(40)], axis=1)
    flat = np.concatenate([10.0 * ring, [[0, 0, 5.0]]])
    yield "slivers on a circle", flat, Delaunay(flat, qhull_options="QJ").simplices


def odd_shells() -> Iterator[Shape]:
    """Surfaces: name, points (n, 3), triangles (t, 3)."""
    mesh = box_mesh((20.0, 10.0, 5.0), (4, 2, 2))
    used, rows = np.unique(mesh.boundary, return_inverse=True)
    points, shell = mesh.points[used], rows.reshape(-1, 3)
    n = len(points)
    yield "shell", points, shell
    yield "shell inside out", points, shell[:, ::-1]
    yield "shell with a hole", points, shell[1:]
    yield "shell of holes", points, shell[::3]
    yield "shell with a triangle turned", points, np.concatenate([shell[:1, ::-1], shell[1:]])
    yield "shell with half of it turned", points, np.concatenate([shell[::2, ::-1], shell[1::2]])
    yield "shell twice", points, np.concatenate([shell, shell])
    yield "shell and itself inside out", points, np.concatenate([shell, shell[:, ::-1]])
    two = np.concatenate([shell, shell + n])
    for word, step in (
        *(("apart", [30, 0, 0]), ("on a face", [20, 0, 0]), ("on an edge", [20, 10, 0])),
        *(("on a corner", [20, 10, 5]), ("through each other", [10, 3, 2])),
        *(("almost touching", [20 + 1e-9, 0, 0]), ("almost in one place", [1e-3, 1e-3, 1e-3])),
    ):
        yield f"two shells {word}", np.concatenate([points, points + np.array(step, float)]), two
    small = 0.3 * points + [7.0, 3.5, 1.75]
    yield (
        "shell with a cavity",
        np.concatenate([points, small]),
        np.concatenate([shell, shell[:, ::-1] + n]),
    )
    yield "shell in a shell", np.concatenate([points, small]), two
    for word, value in (("NaN", np.nan), ("infinity", np.inf), ("1e30", 1e30)):
        spoiled = np.array(points)
        spoiled[3, 2] = value
        yield f"shell with {word}", spoiled, shell
    for size in (1e-20, 1e-6, 1e6, 1e20):
        yield f"shell {size:g} times as large", points * size, shell
    for far in (1e5, 1e8):
        yield f"shell {far:g} mm away", points + far, shell
    yield "flat shell", points * [1, 1, 0], shell
    for height in (1e-6, 2e-3):
        yield f"shell {height:g} times as high", points * [1, 1, height], shell
    yield "needle", points * [4, 0.01, 0.02], shell
    yield "one triangle", TET[:3], ONE[:, :3]
    yield "a triangle and its back", TET[:3], np.array([[0, 1, 2], [0, 2, 1]])
    yield "triangles of one point", TET[:3], np.zeros((4, 3), dtype=int)
    wall = np.concatenate([points, [[10.0, 5.0, 2.0]]])
    fin = np.array([[0, 1, n], [1, 0, n]])
    yield "shell with a fin", wall, np.concatenate([shell, fin])
    yield "triangles at random", points, np.random.default_rng(0).integers(0, n, (60, 3))
    mixed = np.random.default_rng(1).permutation(n)
    yield "shell with its points mixed up", points[mixed], shell
    for amount in (0.2, 2.0, 20.0):
        noise = np.random.default_rng(2).normal(size=points.shape)
        yield f"shell shaken by {amount:g} mm", points + amount * noise, shell
    ball = np.random.default_rng(3).normal(size=(150, 3))
    ball = 10.0 * ball / np.linalg.norm(ball, axis=1)[:, None]
    hull = ConvexHull(ball)
    outward = np.einsum("ij,ij->i", _normals(ball, hull.simplices), ball[hull.simplices[:, 0]]) > 0
    skin = np.where(outward[:, None], hull.simplices, hull.simplices[:, ::-1]).astype(np.int64)
    yield "ball of slivers", ball, skin
    yield "ball of spikes", ball * (1.0 + 3.0 * (np.arange(150) % 7 == 0))[:, None], skin
    for name, radius, twist in (("torus that cuts itself", 3.0, 0), ("Moebius strip", 20.0, 1)):
        yield name, *_swept(radius, twist)


def _normals(points: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.float64]:
    a, b, c = np.moveaxis(points[rows], 1, 0)
    return np.cross(b - a, c - a)


def _swept(radius: float, twist: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Torus of tube 6 mm; with a twist, a band one triangle wide that has one side."""
    along, round_ = (24, 2) if twist else (24, 12)
    i, j = np.divmod(np.arange(along * round_), round_)
    turn = 2.0 * np.pi * i / along
    angle = 2.0 * np.pi * j / round_ + 0.5 * twist * turn
    reach = radius + 6.0 * np.cos(angle)
    points = np.stack([reach * np.cos(turn), reach * np.sin(turn), 6.0 * np.sin(angle)], axis=1)
    ends = i == along - 1
    behind = (j + (1 if twist else 0) * ends) % round_
    a, b = i * round_ + j, (i + 1) % along * round_ + behind
    side = (j + 1) % round_
    c, d = (
        i * round_ + side,
        (i + 1) % along * round_ + (side + (1 if twist else 0) * ends) % round_,
    )
    rows = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return points, rows[: len(rows) // 2 * 2 : round_ if twist else 1]
