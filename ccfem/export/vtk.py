"""Toolpaths as a VTK PolyData file (.vtp), for ParaView and PyVista."""

import base64
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from ccfem.arrays import FloatArray
from ccfem.errors import InputError
from ccfem.io.whole import whole_file
from ccfem.toolpaths import Toolpaths

__all__ = ["write_paths"]

_EFFORT = 4
"""Compression level of zlib, 1 to 9; higher ones make the files of the loop no smaller."""

_TYPES = {"f": ("f8", "Float64"), "b": ("u1", "UInt8")}
"""Of arrays by the kind of their data type; Int64 for all others."""


def write_paths(
    toolpaths: Toolpaths,
    path: str | Path,
    path_data: Mapping[str, FloatArray] | None = None,
) -> None:
    """Write toolpaths to a ``.vtp`` file, whole or not at all.

    Every path is one polyline, in the frame of the mesh, mm. The file holds the normals and, at
    each point, ``link`` (1 where the step to the next point is one); for each path ``layer``,
    ``kind`` (index into `toolpaths.KINDS`), ``closed`` and ``length``. Its arrays are compressed.

    Parameters
    ----------
    toolpaths : Toolpaths
    path : str or Path
    path_data : mapping of name to (K,) array, optional
        Further values, one per path.

    Raises
    ------
    InputError
        When the file cannot be written, or an array has the wrong length.
    """
    points: dict[str, NDArray[Any]] = {"normals": toolpaths.normals, "link": toolpaths.link}
    paths: dict[str, NDArray[Any]] = {
        "layer": toolpaths.layer,
        "kind": toolpaths.kind,
        "closed": toolpaths.closed,
        "length": toolpaths.lengths,
        **(path_data or {}),
    }
    for name, values in paths.items():
        if len(values) != len(toolpaths):
            raise InputError(
                f"'{name}' must have one value per path, {len(toolpaths)} in all; got {len(values)}"
            )
    with whole_file(path) as temporary, open(temporary, "w", encoding="ascii") as file:
        file.writelines(_lines(toolpaths, points, paths))


def _lines(
    toolpaths: Toolpaths, points: Mapping[str, NDArray[Any]], paths: Mapping[str, NDArray[Any]]
) -> Iterator[str]:
    """Lines of the XML file (VTK file formats, "PolyData")."""
    yield '<?xml version="1.0"?>\n'
    yield (
        '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">\n'
    )
    yield (
        f'<PolyData><Piece NumberOfPoints="{len(toolpaths.points)}" NumberOfVerts="0" '
        f'NumberOfLines="{len(toolpaths)}" NumberOfStrips="0" NumberOfPolys="0">\n'
    )
    yield '<PointData Normals="normals">\n'
    yield from (_array(name, values) for name, values in points.items())
    yield '</PointData>\n<CellData Scalars="layer">\n'
    yield from (_array(name, values) for name, values in paths.items())
    yield "</CellData>\n<Points>\n" + _array("Points", toolpaths.points) + "</Points>\n<Lines>\n"
    yield _array("connectivity", np.arange(len(toolpaths.points)))
    yield _array("offsets", toolpaths.offsets[1:])
    yield "</Lines>\n</Piece></PolyData>\n</VTKFile>\n"


def _array(name: str, values: NDArray[Any]) -> str:
    """One DataArray, inline in base64: one block of zlib with its sizes in bytes before it."""
    values = np.asarray(values)
    size, name_of_type = _TYPES.get(values.dtype.kind, ("i8", "Int64"))
    data = np.ascontiguousarray(values, dtype=f"<{size}").tobytes()
    packed = zlib.compress(data, _EFFORT) if data else b""
    # Number of blocks, size of a block, of a last one that is shorter, and of each when packed.
    sizes = [1, len(data), 0, len(packed)] if data else [0, 0, 0]
    header = np.array(sizes, dtype="<u8").tobytes()
    text = (base64.b64encode(header) + base64.b64encode(packed)).decode("ascii")
    components = values.shape[1] if values.ndim == 2 else 1
    return (
        f'<DataArray type="{name_of_type}" Name={quoteattr(name)} '
        f'NumberOfComponents="{components}" format="binary">{text}</DataArray>\n'
    )
