"""Regions of critical stress, with the direction of the least principal stress.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998, section 2: layers are weakest along their
normal, which should follow the least principal stress where the largest is high.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh

_FEWEST = 10
"""Number of cells of the smallest region that counts."""
_EVEN = 1e-6
"""Weight of an edge between cells with equal directions, so that it counts as an edge."""


@dataclass(frozen=True)
class StressRegions:
    """Regions where the layers should follow the stress.

    Attributes
    ----------
    critical : (m,) bool array
        Cells whose largest principal stress is high.
    region : (m,) int array
        Number of the region of each cell, largest first; -1 outside.
    direction : (m, 3) array
        Direction of the least principal stress, smoothed and of one sense in each region; zero
        outside.
    largest : (m,) array, MPa
        Largest principal stress.
    """

    critical: BoolArray
    region: IntArray
    direction: FloatArray
    largest: FloatArray

    def __post_init__(self) -> None:
        freeze(self, critical=bool, region=int, direction=float, largest=float)

    @property
    def count(self) -> int:
        """Number of regions."""
        return int(self.region.max()) + 1


def stress_regions(
    mesh: TetMesh,
    stress: FloatArray,
    build: FloatArray,
    share: float = 0.16,
    quantile: float = 0.995,
    gap: float = 0.1,
    alignment: float = 0.75,
    most: int = 10,
    smoothing: int = 200,
) -> StressRegions:
    """Find regions of critical stress.

    Parameters
    ----------
    stress : (m, 3, 3) array, MPa
    build : (3,) array
        The mean direction of a region does not point against it.
    share : float, default 0.16
        A cell is critical if its largest principal stress is above this share of the peak.
    quantile : float, default 0.995
        Quantile, over the volume, that is taken as the peak. With 1, as published, it is the
        maximum, which a single cell at the rim of a hole decides.
    gap : float, default 0.1
        Critical cells whose middle and least principal stress differ by less than this share of
        the largest have no distinct direction and belong to no region; published: 0.
    alignment : float, default 0.75
        Least cosine of the angle between the directions of neighbours, or of neighbours of
        neighbours, that belong to one region.
    most : int, default 10
        Largest number of regions that are kept, largest first; none has less than 10 cells.
    smoothing : int, default 200
        Passes in which each direction is averaged with those of its neighbours in the region.

    Raises
    ------
    InputError
        When no region is found.
    """
    values, axes = np.linalg.eigh(stress)
    largest, volume = values[:, 2], mesh.volumes
    # Critical cells, with a direction of least stress that is distinct from the second one.
    critical = largest > share * _peak(largest, volume, quantile)
    distinct = values[:, 1] - values[:, 0] >= gap * np.abs(largest)
    cells = np.flatnonzero(critical & distinct & (largest > 0.0))
    if not len(cells):
        raise InputError(
            "no cell is critical and has a direction of least stress: lower share or gap, or give "
            "a load that pulls"
        )
    axis = axes[cells, :, 0]
    label, signed = _grown_regions(mesh, cells, axis, alignment)
    number = _largest_regions(label, volume[cells], most)
    if number.max() < 0:
        raise InputError(
            f"no region of critical stress has {_FEWEST} cells: lower share, gap or alignment, or "
            "mesh the part finer"
        )
    kept = number >= 0
    cells, number, signed = cells[kept], number[kept], signed[kept]
    smooth = _smoothed_axes(mesh, cells, number, signed, smoothing)
    # Regions rise along the build direction.
    rising = np.bincount(number, volume[cells] * (smooth @ build))
    smooth = smooth * np.where(rising < 0.0, -1.0, 1.0)[number, None]
    region = np.full(len(mesh.cells), -1)
    region[cells] = number
    direction = np.zeros((len(mesh.cells), 3))
    direction[cells] = smooth
    return StressRegions(critical, region, direction, largest)


def _peak(values: FloatArray, volume: FloatArray, quantile: float) -> float:
    """Value that is exceeded in the rest of the volume."""
    order = np.argsort(values, kind="stable")
    along = np.cumsum(volume[order]) / volume.sum()
    at = min(int(np.searchsorted(along, quantile)), len(order) - 1)
    return float(values[order[at]])


def _face_adjacency(mesh: TetMesh) -> sp.csr_array:
    """Cells that share a face, as a matrix of ones."""
    one, other = mesh.neighbours.T
    n = len(mesh.cells)
    half = sp.coo_array((np.ones(len(one)), (one, other)), shape=(n, n))
    return sp.csr_array(half + half.T)


def _grown_regions(
    mesh: TetMesh, cells: IntArray, axis: FloatArray, alignment: float
) -> tuple[IntArray, FloatArray]:
    """Label connected aligned cells, and give their axes one sense in each region.

    Senses follow the spanning tree of the best-aligned pairs.
    """
    # Neighbours, and theirs: directions jump from cell to cell of a coarse mesh.
    near = _face_adjacency(mesh)
    second = sp.csr_array(near + near @ near)[cells][:, cells].tocoo()
    one, other = second.row, second.col
    once = one < other
    one, other = one[once], other[once]
    cosine = np.einsum("kd,kd->k", axis[one], axis[other])
    alike = np.abs(cosine) > alignment
    one, other, cosine = one[alike], other[alike], cosine[alike]
    n = len(cells)
    weight = 1.0 - np.abs(cosine) + _EVEN
    tree = minimum_spanning_tree(sp.csr_array((weight, (one, other)), shape=(n, n)))
    label = connected_components(tree, directed=False)[1]
    sense = np.zeros(n)
    for first in np.unique(label, return_index=True)[1].tolist():
        order, before = breadth_first_order(tree, first, directed=False)
        sense[first] = 1.0
        for cell in order[1:].tolist():
            parent = before[cell]
            sense[cell] = sense[parent] * (1.0 if axis[cell] @ axis[parent] > 0.0 else -1.0)
    return label, axis * sense[:, None]


def _largest_regions(label: IntArray, volume: FloatArray, most: int) -> IntArray:
    """Numbers of the largest regions by volume, from 0; -1 for cells of the others."""
    size, total = np.bincount(label), np.bincount(label, volume)
    total[size < _FEWEST] = 0.0
    largest = np.argsort(-total, kind="stable")[:most]
    largest = largest[total[largest] > 0.0]
    number = np.full(len(size), -1)
    number[largest] = np.arange(len(largest))
    return number[label]


def _smoothed_axes(
    mesh: TetMesh, cells: IntArray, number: IntArray, axis: FloatArray, passes: int
) -> FloatArray:
    """Directions after a number of passes of averaging over neighbours in the region."""
    near = _face_adjacency(mesh)[cells][:, cells].tocoo()
    same = number[near.row] == number[near.col]
    n = len(cells)
    ends = (near.row[same], near.col[same])
    mean = sp.csr_array((np.ones(len(ends[0])), ends), shape=(n, n)) + sp.eye_array(n)
    for _ in range(passes):
        axis = mean @ axis
        axis = axis / np.maximum(np.linalg.norm(axis, axis=1), 1e-300)[:, None]
    return np.asarray(axis)
