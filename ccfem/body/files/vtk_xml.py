"""VTK's XML files (.vtu, .vtp), written here: VTK's own writer ends the process on a full disk.

Arrays are inline, compressed and in base64. There are no arrays of strings, which meshio refuses:
text is the bytes of its UTF-8 (`as_bytes`).
"""

import base64
import re
import tempfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ccfem.base.errors import InputError, shown
from ccfem.base.row_blocks import RowBlocks

_EFFORT = 4
"""Compression level of zlib, 1 to 9; higher ones make the files of the loop no smaller."""
_TYPES = {"f": ("f8", "Float64"), "b": ("u1", "UInt8")}
"""Of arrays by the kind of their data type; unsigned bytes stay so, all others are Int64."""
_NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def write_vtk_xml(
    path: Path,
    kind: str,
    counts: Mapping[str, int],
    sections: Mapping[str, Mapping[str, ArrayLike]],
    field: Mapping[str, ArrayLike] | None = None,
    components: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Write one piece of a data set; to be called with a file of `whole_file`.

    Parameters
    ----------
    kind : str
        ``UnstructuredGrid`` or ``PolyData``.
    counts : mapping of name to int
        How many points and cells there are, as ``{"Points": 4, "Cells": 1}``.
    sections : mapping of tag to mapping of name to array
        ``PointData``, ``Points`` and so on, with their arrays (k,) or (k, c); the tag may have
        attributes, as in ``PointData Normals="normals"``.
    field : mapping of name to array, optional
        Data of the whole.
    components : mapping of name to names, optional
        Names of the components of arrays of points and cells.

    Raises
    ------
    InputError
        When a name has characters that XML does not know.
    OSError
        When the file cannot be written.
    """
    for name in [name for arrays in (*sections.values(), field or {}) for name in arrays]:
        if _NOT_IN_XML.search(name):
            raise InputError(
                f"the name {shown(name)} has characters that a file of VTK cannot hold: rename it"
            )
    with path.open("w", encoding="utf-8") as file:
        about = (field or {}, components or {}, path.parent)
        file.writelines(_file_lines(kind, counts, sections, *about))


def as_bytes(text: str) -> NDArray[np.uint8]:
    """Text as an array of the bytes of its UTF-8."""
    return np.frombuffer(text.encode(), dtype=np.uint8)


def _file_lines(
    kind: str,
    counts: Mapping[str, int],
    sections: Mapping[str, Mapping[str, ArrayLike]],
    field: Mapping[str, ArrayLike],
    components: Mapping[str, Sequence[str]],
    folder: Path,
) -> Iterator[str]:
    """Lines of the file (VTK file formats, "XML File Formats")."""
    yield '<?xml version="1.0" encoding="UTF-8"?>\n'
    yield (
        f'<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64" '
        f'compressor="vtkZLibDataCompressor">\n<{kind}>\n'
    )
    if field:
        yield "<FieldData>\n"
        for name, values in field.items():
            more = f' NumberOfTuples="{len(np.asarray(values))}"'
            yield from _array(name, values, folder, more)
        yield "</FieldData>\n"
    numbers = " ".join(f'NumberOf{name}="{count}"' for name, count in counts.items())
    yield f"<Piece {numbers}>\n"
    for tag, arrays in sections.items():
        yield f"<{tag}>\n"
        for name, values in arrays.items():
            titles = enumerate(components.get(name, ()))
            more = "".join(f' ComponentName{k}="{s}"' for k, s in titles)
            yield from _array(name, values, folder, more)
        yield f"</{tag.partition(' ')[0]}>\n"
    yield f"</Piece>\n</{kind}>\n</VTKFile>\n"


_ROWS = 500_000
"""Rows that are packed, and triples of bytes that are written, at a time: some fill memory."""
_PACKED = 50_000_000
"""Bytes that are packed in memory; more stand beside the file until their number is known."""


def _array(name: str, given: ArrayLike, folder: Path, more: str = "") -> Iterator[str]:
    """Yield one DataArray: one block of zlib with its sizes in bytes before it."""
    values = given if isinstance(given, RowBlocks | range) else np.asarray(given)
    begin = np.asarray(values[:1], dtype=np.int64 if isinstance(values, range) else None)
    size, name_of_type = _TYPES.get(begin.dtype.kind, ("i8", "Int64"))
    if begin.dtype == np.uint8:
        size, name_of_type = _TYPES["b"]
    columns = f' NumberOfComponents="{begin.shape[1]}"' if begin.ndim == 2 else ""
    yield (
        f'<DataArray type="{name_of_type}" Name={quoteattr(name)}{columns}{more} format="binary">'
    )
    packer, count = zlib.compressobj(_EFFORT), 0
    with tempfile.SpooledTemporaryFile(_PACKED, dir=str(folder)) as packed:
        for first in range(0, len(values), _ROWS):
            data = np.ascontiguousarray(values[first : first + _ROWS], dtype=f"<{size}").tobytes()
            packed.write(packer.compress(data))
            count += len(data)
        packed.write(packer.flush() if count else b"")
        # Number of blocks, size of a block, of a last one that is shorter, and of each when packed.
        sizes = [1, count, 0, packed.tell()] if count else [0, 0, 0]
        yield base64.b64encode(np.array(sizes, dtype="<u8").tobytes()).decode("ascii")
        packed.seek(0)
        while part := packed.read(3 * _ROWS):  # whole groups of three bytes
            yield base64.b64encode(part).decode("ascii")
    yield "</DataArray>\n"
