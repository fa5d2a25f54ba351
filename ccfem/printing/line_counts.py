"""About how many lines a print has, and the numbers beyond which it is not planned."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer

MOST_LINES = 1e6
"""Lines of matrix: some minutes, and about 3 GB."""
MOST_STRANDS = 5e5
"""Strands side by side, on all layers. A plate of 400 x 300 mm has 200,000 on 600 layers, which are
mostly alike and take a quarter of an hour; where all layers differ, it takes some hours."""


def check_matrix_lines(mesh: TetMesh, build: Sequence[float], machine: Machine) -> None:
    """Refuse a print whose matrix would need more than a million lines.

    They fill the volume of the part, and are as long as its mean section is wide.
    """
    height, section = _mean_section(mesh, build)
    layers = height / machine.matrix_height
    lines = layers * np.sqrt(section) / machine.matrix_width
    if lines > MOST_LINES:
        raise InputError(
            f"the print would have about {layers:,.0f} layers of matrix and {lines:,.0f} lines, "
            f"{lines * np.sqrt(section) / 1e6:,.0f} km, of {machine.matrix_height:g} x "
            f"{machine.matrix_width:g} mm; at most {MOST_LINES:,.0f} lines are planned: raise "
            "matrix_height or matrix_width in [machine]; are all lengths in mm?"
        )


def _mean_section(mesh: TetMesh, build: Sequence[float]) -> tuple[float, float]:
    """Height of a part along its build direction, mm, and its mean section across it, mm^2."""
    along = np.asarray(build, dtype=np.float64)
    height = float(np.ptp(mesh.points @ (along / np.linalg.norm(along))))
    return height, float(mesh.volumes.sum()) / height


def about_strands(mesh: TetMesh, layers: int, build: Sequence[float], machine: Machine) -> float:
    """About how many strands side by side a number of flat layers holds, rather more."""
    _, section = _mean_section(mesh, build)
    return layers * float(np.sqrt(section)) / machine.fibre_width


def check_strands(layers: Sequence[Layer], machine: Machine) -> None:
    """Refuse layers that hold more than half a million strands side by side."""
    areas: FloatArray = np.array([layer.areas.sum() for layer in layers])
    strands = float(np.sqrt(areas).sum()) / machine.fibre_width
    if strands > MOST_STRANDS:
        raise InputError(
            f"{len(layers):,} layers would have about {strands:,.0f} strands, "
            f"{areas.sum() / machine.fibre_width / 1e6:,.0f} km, of {machine.fibre_width:g} mm "
            f"width; at most {MOST_STRANDS:,.0f} strands are planned: raise fibre_width in "
            "[machine], or choose fewer layers; are all lengths in mm?"
        )
