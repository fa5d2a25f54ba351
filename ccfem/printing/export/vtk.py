"""Toolpaths as a VTK PolyData file (.vtp), for ParaView and PyVista."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.whole import whole_file
from ccfem.body.files.vtk_xml import write_vtk_xml
from ccfem.paths.toolpaths import Toolpaths


def write_paths(
    toolpaths: Toolpaths, path: str | Path, path_data: Mapping[str, FloatArray] | None = None
) -> None:
    """Write toolpaths to a ``.vtp`` file, whole or not at all.

    Every path is one polyline, in the frame of the mesh, mm. The file holds the normals and, at
    each point, ``link`` (1 where the step to the next point is one); for each path ``layer``,
    ``kind`` (index into `toolpaths.KINDS`), ``closed`` and ``length``. Its arrays are compressed.

    Parameters
    ----------
    path_data : mapping of name to (K,) array, optional
        Further values, one per path.

    Raises
    ------
    InputError
        When the file cannot be written, or an array has the wrong length.
    """
    points: dict[str, ArrayLike] = {"normals": toolpaths.normals, "link": toolpaths.link}
    paths: dict[str, ArrayLike] = {
        "layer": toolpaths.layer,
        "kind": toolpaths.kind,
        "closed": toolpaths.closed,
        "length": toolpaths.lengths,
        **(path_data or {}),
    }
    for name, values in paths.items():
        if np.shape(values)[:1] != (len(toolpaths),):
            raise InputError(
                f"'{name}' must have one value per path, {len(toolpaths)} in all; got "
                f"{np.size(values)}"
            )
    with whole_file(path) as temporary:
        write_vtk_xml(
            temporary,
            "PolyData",
            {"Points": len(toolpaths.points), "Lines": len(toolpaths)},
            {
                'PointData Normals="normals"': points,
                'CellData Scalars="layer"': paths,
                "Points": {"Points": toolpaths.points},
                "Lines": {
                    "connectivity": range(len(toolpaths.points)),
                    "offsets": toolpaths.offsets[1:],
                },
            },
        )
