"""A piece of a layer with joints, cut open along the curves that join them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.paths.fields.layer_elements import Surface
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.winding_curves.joining_curves import border_tree, join
from ccfem.strategies.winding_curves.triangle_mesh import TriangleMesh


@dataclass(frozen=True)
class Piece:
    """A connected piece of a layer, with the borders of its joints."""

    layer: Layer
    mesh: TriangleMesh  # points of the layer keep their numbers
    loops: tuple[IntArray, ...]  # points of the border of each joint's hole
    outer: tuple[IntArray, ...]  # all other loops of its border
    # Points of each curve that joins holes; none before it is `joined`.
    curves: tuple[IntArray, ...] = ()

    @property
    def surface(self) -> Surface:
        """Its triangles, for the field."""
        return Surface(self.mesh.points, self.mesh.triangles)

    def joined(self, repulsion: float) -> "Piece":
        """Join its holes by curves that keep off the outer border: see `join`."""
        mesh, curves = join(self.mesh, self.loops, self.outer, repulsion)
        return Piece(self.layer, mesh, self.loops, self.outer, tuple(curves))

    def inner_values(self, lift: float, rise: float, reach: float) -> tuple[IntArray, FloatArray]:
        """Points of its holes and curves, and the values of the field there.

        Parameters
        ----------
        lift : float
            How far below 0 the holes are, and the curves near them.
        rise : float
            How far below 0 the curves are, per relative excess of their distance from the outer
            border over that of the holes: strands there keep their distance round the holes.
        reach : float, mm
            Distance from the holes along the curves over which `lift` acts.
        """
        rim = np.unique(np.concatenate(self.loops))
        if not self.curves:
            return rim, np.full(len(rim), -lift)
        rest = np.setdiff1d(np.concatenate(self.curves), rim)
        points, tree = self.mesh.points, border_tree(self.mesh.points, self.outer)
        if tree is None:
            deep = np.zeros(len(rest))
        else:
            usual = float(np.median(tree.query(points[rim])[0]))
            deep = rise * np.minimum(0.0, 1.0 - tree.query(points[rest])[0] / max(usual, 1e-9))
        holes = border_tree(points, self.loops)
        assert holes is not None
        near = -lift * np.exp(-holes.query(points[rest])[0] / reach)
        return (
            np.concatenate([rim, rest]),
            np.concatenate([np.full(len(rim), -lift), np.minimum(deep, near)]),
        )


def pieces_with_joints(layer: Layer, names: Sequence[str]) -> Iterator[Piece]:
    """Yield each connected piece of a layer with a border round a joint and another border.

    Parameters
    ----------
    names : sequence of str
        Patches of the joints.
    """
    loops = list(joint_loops(layer, names).values())
    first = {int(loop[0]) for loop in loops}
    others = [loop for loop in layer.loops if int(loop[0]) not in first]
    for number in range(int(layer.component.max(initial=-1)) + 1):
        rows = np.flatnonzero(layer.component == number)
        inside = np.zeros(len(layer.points), dtype=bool)
        inside[layer.triangles[rows]] = True
        mine = tuple(loop for loop in loops if inside[loop[0]])
        outer = tuple(loop for loop in others if inside[loop[0]])
        if mine and outer:
            mesh = TriangleMesh(layer.points, layer.triangles[rows], rows)
            yield Piece(layer, mesh, mine, outer)


# Boundary loops of a layer that run round a joint.


_SHARE = 0.4
"""Share of a loop's length that lies on the patch. Half of a hole may carry the load. If a layer
leaves a hole through its outer border, the hole takes only a small share of that."""


def joint_loops(layer: Layer, names: Iterable[str]) -> dict[str, IntArray]:
    """Find the loops of a layer that run round its joints.

    Parameters
    ----------
    names : iterable of str
        Patches; those that the layer does not meet have no loop.

    Returns
    -------
    dict of str to (k,) int arrays
        Points of each loop by the patch that it lies on. If two loops lie on one patch, as where a
        layer meets a hole twice, there is a second entry: the name with a prime.
    """
    loops: dict[str, IntArray] = {}
    taken: set[int] = set()
    for name in names:
        edges = layer.patches.get(name)
        if edges is None or not len(edges):
            continue
        keys = {tuple(edge) for edge in np.sort(edges, axis=1).tolist()}
        for k, loop in enumerate(layer.loops):
            after = np.roll(loop, -1)
            length = np.linalg.norm(layer.points[after] - layer.points[loop], axis=1)
            sides = np.sort(np.stack([loop, after], axis=1), axis=1).tolist()
            on = np.array([tuple(side) in keys for side in sides])
            if k in taken or length[on].sum() < _SHARE * length.sum():
                continue
            taken.add(k)
            while name in loops:
                name += "'"
            loops[name] = loop
    return loops
