"""The result of a solve as a VTK unstructured grid (.vtu), for ParaView and other programs."""

from pathlib import Path

import numpy as np

from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError
from ccfem.io.vtu import grid_of
from ccfem.io.vtu_tensors import UNIT, set_tensors
from ccfem.io.whole import whole_file
from ccfem.tensor import principal

__all__ = ["result_path", "write_result"]


def result_path(path: str | Path, case: str = "") -> Path:
    """Name of the file of a load case; of the whole result without one.

    Raises
    ------
    InputError
        When the name does not end in ``.vtu``.
    """
    path = Path(path)
    if path.suffix.lower() != ".vtu":
        raise InputError(f"a result is a VTK unstructured grid; got {path}: end it in .vtu")
    return path.with_name(f"{path.stem}-{case}{path.suffix}") if case else path


def write_result(field: StressField, path: str | Path) -> None:
    """Write a solution to a ``.vtu`` file, whole or not at all.

    At the nodes: displacement, reaction, and recovered stress and strain. In the cells: stress,
    strain, principal stresses, largest first, with a unit vector along the axis of each, and the
    estimated error over the mean stress. Patches are field data ``patch:NAME``; units of stress and
    length, and the load case, are field data too. Tensors have six components by name, shear of
    the strain being half the engineering one.

    Parameters
    ----------
    field : StressField
    path : path

    Raises
    ------
    InputError
        When the name does not end in ``.vtu``, or the file cannot be written.
    """
    path = result_path(path)
    grid = grid_of(field.mesh)
    grid.point_data["displacement"] = np.array(field.displacement)
    grid.point_data["reaction"] = np.array(field.reactions)
    set_tensors(grid.point_data, "stress", field.nodal)
    set_tensors(grid.point_data, "strain", field.nodal_strain)
    set_tensors(grid.cell_data, "stress", field.stress)
    set_tensors(grid.cell_data, "strain", field.strain)
    values, axes = principal(field.stress)
    grid.cell_data["principal_stress"] = np.array(values)
    for k in range(3):
        grid.cell_data[f"principal_direction_{k + 1}"] = np.ascontiguousarray(axes[:, :, k])
    grid.cell_data["error"] = field.error.densities(field.mesh.volumes)
    grid.field_data["load case"] = [field.case]
    grid.field_data[UNIT] = ["MPa"]
    grid.field_data["unit of length"] = ["mm"]
    with whole_file(path) as temporary:
        grid.save(temporary)
