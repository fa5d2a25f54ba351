"""Toolpaths (.vtp) and results of a solve (.vtu) as files of VTK, for ParaView and others."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError, shown
from ccfem.base.tensor import principal
from ccfem.base.whole import whole_file
from ccfem.body.files.formats import vtu
from ccfem.body.files.vtk_xml import as_bytes, write_vtk_xml
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.fem.stress_files.stress_file import UNIT, VTK_COMPONENTS, vtk_tensors
from ccfem.paths.toolpaths import Toolpaths


def write_paths(
    toolpaths: Toolpaths, path: str | Path, path_data: Mapping[str, FloatArray] | None = None
) -> None:
    """Write toolpaths to a ``.vtp`` file, whole or not at all.

    Every path is one polyline, in the frame of the mesh, mm. The file holds the normals and, at
    each point, ``link`` (1 where the step to the next point is one); for each path ``layer``,
    ``kind`` (index into `toolpaths.KINDS`), ``closed`` and ``length``, and further data (K,) by
    name. Its arrays are compressed.
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


# The result of a solve.


def result_path(path: str | Path, case: str = "") -> Path:
    """Name of the file of a load case; of the whole result without one."""
    path = Path(path)
    if path.suffix.lower() != ".vtu":
        raise InputError(f"a result is a VTK unstructured grid; got {path}: end it in .vtu")
    if {"/", "\\", "\0"} & set(case):
        raise InputError(
            f"the name of load case {shown(case)} cannot stand in that of a file: rename it, or "
            "take it alone by --load-case"
        )
    return path.with_name(f"{path.stem}-{case}{path.suffix}") if case else path


def write_result(field: StressField, path: str | Path) -> None:
    """Write a solution to a ``.vtu`` file, whole or not at all.

    At the nodes: displacement, reaction, and recovered stress and strain. In the cells: stress,
    strain, principal stresses, largest first, with a unit vector along the axis of each, and the
    estimated error over the mean stress. Patches are field data ``patch:NAME``; units of stress and
    length, and the load case, are field data too, as the bytes of their UTF-8, since meshio reads
    no strings. Tensors have six components by name, shear of the strain being half the engineering
    one.
    """
    path = result_path(path)
    values, axes = principal(field.stress)
    with whole_file(path) as temporary:
        vtu.write(
            field.mesh,
            temporary,
            {
                "displacement": field.displacement,
                "reaction": field.reactions,
                "stress": vtk_tensors(field.nodal),
                "strain": vtk_tensors(field.nodal_strain),
            },
            {
                "stress": vtk_tensors(field.stress),
                "strain": vtk_tensors(field.strain),
                "principal_stress": values,
                **{f"principal_direction_{k + 1}": axes[:, :, k] for k in range(3)},
                "error": field.error.densities(field.mesh.volumes),
            },
            {
                "load case": as_bytes(field.case),
                UNIT: as_bytes("MPa"),
                "unit of length": as_bytes("mm"),
            },
            dict.fromkeys(("stress", "strain"), VTK_COMPONENTS),
        )
