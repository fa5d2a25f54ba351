"""Layers made by another program, one surface a file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.foreign import layer_from_surface
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.slicer import Vector


@dataclass(frozen=True)
class Surfaces:
    """Curved layers read from the OBJ files in a folder, ordered by the numbers in their names.

    Attributes
    ----------
    folder : str
    thickness : float, mm, default 0.5
        Thickness of the layers, which files of surfaces do not state.
    tolerance : float, mm, default 1
        Largest distance by which points may lie outside the part.
    """

    folder: str = "."
    thickness: float = 0.5
    tolerance: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, "thickness", "tolerance", above=0.0, unit="mm")

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Read the layers; the stress has no influence."""
        files = sorted(Path(self.folder).glob("*.obj"), key=_number)
        if not files:
            raise InputError(
                f"no .obj file in the folder '{self.folder}': give the folder of the layers "
                "(surfaces:folder=...)"
            )
        return tuple(
            layer_from_surface(stress.mesh, *_read(file), k, self.thickness, self.tolerance)
            for k, file in enumerate(files)
        )


def _number(path: Path) -> tuple[int, str]:
    digits = "".join(c for c in path.stem if c.isdecimal())
    return int(digits or 0), path.stem


def _read(path: Path) -> tuple[FloatArray, IntArray]:
    """Points and triangles of an OBJ file."""
    points, triangles = [], []
    try:
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                triangles.append([int(word.split("/")[0]) for word in words[1:]])
        found = np.array(points, dtype=np.float64).reshape(-1, 3)
        corners = np.array(triangles, dtype=np.int64).reshape(-1, 3) - 1
    except (ValueError, IndexError, OverflowError):
        raise InputError(f"{path} is no OBJ file of triangles: export it again") from None
    if not len(corners) or corners.min() < 0 or corners.max() >= len(found):
        raise InputError(f"{path} has no triangles, or they name points that it has not")
    return found, corners
