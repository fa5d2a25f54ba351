"""Plates as images: a mesh of the pixels of a mask, and values of its cells as an image."""

from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.errors import InputError
from ccfem.fem.plates.mesh import PlaneMesh


def raster_mesh(
    mask: BoolArray, size: float = 1.0, origin: tuple[float, float] = (0.0, 0.0)
) -> PlaneMesh:
    """Mesh of the true pixels of an image, one square cell each.

    Parameters
    ----------
    mask : (H, W) bool array
        Row 0 is the top, so pixel (i, j) covers x from ``j * size`` and y from
        ``(H - 1 - i) * size``.
    size : float, mm
        Side of a pixel.
    origin : tuple of 2 floats, mm
        Lower left corner of the image.

    Returns
    -------
    PlaneMesh
        Cells in the order of ``mask``: ``image[mask]`` are values per cell and ``image[mask] =
        values`` puts them back. Corners from the lower left one, counter-clockwise. Nodes are
        numbered along the shorter side first. Patches x_min, x_max, y_min, y_max: the edges on
        the sides of the box that holds the part.

    Raises
    ------
    InputError
        For an image without a true pixel, and a size that is not positive.
    """
    mask = np.asarray(mask, dtype=bool)
    if mask.ndim != 2 or not mask.any() or not size > 0.0:
        raise InputError(
            f"a raster needs an (H, W) mask with a true pixel and a pixel size > 0 mm; got shape "
            f"{mask.shape}, {int(mask.sum())} true pixels and size {size}"
        )
    (height, width), (rows, columns) = mask.shape, np.nonzero(mask)
    left, low = columns, height - 1 - rows
    x = left[:, None] + np.array([0, 1, 1, 0])
    y = low[:, None] + np.array([0, 0, 1, 1])
    # Numbered along the shorter side first: a narrow band.
    number = x * (height + 1) + y if height <= width else y * (width + 1) + x
    used, cells = np.unique(number, return_inverse=True)
    divisor = height + 1 if height <= width else width + 1
    place = np.stack(np.divmod(used, divisor), axis=1)
    place = place if height <= width else place[:, ::-1]
    mesh = PlaneMesh(place * size + np.array(origin), cells.reshape(-1, 4))
    patches = {}
    for k, axis in enumerate("xy"):
        for side, level in (("min", place[:, k].min()), ("max", place[:, k].max())):
            patches[f"{axis}_{side}"] = mesh.boundary_where(place[:, k] == level)
    return mesh.with_patches(patches)


class Raster(NamedTuple):
    """Values of the cells of a raster mesh as an image.

    Attributes
    ----------
    image : (H, W) array
        Row 0 is the top; zero where there is no cell.
    inside : (H, W) bool array
        Pixels that are cells.
    size : float, mm
        Side of a pixel.
    origin : (2,) array, mm
        Lower left corner of the image.
    """

    image: FloatArray
    inside: BoolArray
    size: float
    origin: FloatArray


def raster_image(mesh: PlaneMesh, values: FloatArray) -> Raster:
    """Values (m,) of the cells of a raster mesh as an image: `raster_mesh` backwards.

    Raises
    ------
    InputError
        When the cells are not squares of one size on one grid.
    """
    low, high = (mesh.points[mesh.cells].min(axis=1), mesh.points[mesh.cells].max(axis=1))
    size = float((high - low)[0, 0])
    place = (low - mesh.bounds[0]) / size
    pixel = np.rint(place).astype(np.int64)
    square = np.abs(high - low - size).max() <= 1e-6 * size
    if mesh.cells.shape[1] != 4 or not square or np.abs(place - pixel).max() > 1e-6:
        raise InputError("an image needs a mesh of equal squares on one grid: use raster_mesh")
    width, height = pixel.max(axis=0) + 1
    rows, columns = height - 1 - pixel[:, 1], pixel[:, 0]
    image, inside = np.zeros((height, width)), np.zeros((height, width), dtype=bool)
    image[rows, columns], inside[rows, columns] = values, True
    return Raster(image, inside, size, np.array(mesh.bounds[0]))
