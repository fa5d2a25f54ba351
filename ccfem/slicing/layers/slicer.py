"""The protocol that slicers follow, and what holds for the layers of them all."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PartStress
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer, curved_layers, flat_layers

Vector = tuple[float, float, float]
Content = TypeVar("Content")


@runtime_checkable
class Slicer(Protocol):
    """A frozen dataclass whose fields are the parameters, called with data.

    Each module of `ccfem.slicing.slicers` is one slicer. The name of the module is its name on the
    command line and in part files; the class has the same name in capitals (``load_oriented``
    holds ``LoadOriented``).

    What it refuses whatever the stress is, as files that are missing, it says in a method
    ``check(mesh, build, machine)`` too, which is called before the part is solved. One whose layers
    are never flat has a class variable ``curved = True``.
    """

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Cut a part into layers, from the first printed to the last.

        Parameters
        ----------
        stress : PartStress
            The part's mesh, and the stress on it for slicers that follow the stress.
        build : tuple of 3 floats
            Build direction in the frame of the mesh, of any length.
        """
        ...


def slicer_remarks(slicer: Slicer, stress: PartStress) -> tuple[str, ...]:
    """Ask a slicer with a method ``remarks`` what it has to say of a part, one line each."""
    remarks = getattr(slicer, "remarks", None)
    return () if remarks is None else tuple(remarks(stress))


# Orientation in which a part of curved layers is printed.


_DOWN = 1e-3
"""Share of the layers' area that may face downwards."""


def has_field(slicer: Slicer) -> bool:
    """Whether the layers of a slicer are the levels of a field, which `slice` returns: curved."""
    return hasattr(slicer, "slice")


def always_curved(slicer: Slicer) -> bool:
    """Whether the layers of a slicer are curved, whatever the part and its stress are."""
    return bool(getattr(slicer, "curved", False))


NO_FIELD = (
    "support continues the field whose levels the layers are, and these layers were given without "
    "one: leave out support, or choose --slicing load_oriented or spatial"
)
"""What is said where support is wanted below curved layers that are no levels."""


def check_field(slicer: Slicer) -> None:
    """Refuse support below layers that are curved and not the levels of a field."""
    if always_curved(slicer) and not has_field(slicer):
        raise InputError(NO_FIELD)


def standing(layers: Sequence[Layer], build: Vector) -> Vector:
    """Choose the unit vector along which layers are stacked on a bed.

    Layers that face downwards can be printed by no head that stands over them, and rest on no
    support. If layers do, as seen along the build direction, the part is rotated so that their mean
    normal points up, as Kipping and Schueppstuhl 2023 do with all parts (section 2.3). Flat layers
    stay as they are.
    """
    up = np.asarray(build, dtype=np.float64) / np.linalg.norm(build)
    area = np.concatenate([layer.areas for layer in layers])
    normals = np.concatenate([layer.normals for layer in layers])
    curved = curved_layers(layers)
    mean = area @ normals
    size = float(np.linalg.norm(mean))
    if curved and area[normals @ up < 0.0].sum() > _DOWN * area.sum() and size > 0.0:
        up = mean / size
    x, y, z = up.tolist()
    return (x, y, z)


# Check of the distance between layers: at least the height of their fibre.


_ROUNDING = 1e-6
"""Share of a strand's height by which layers may be nearer than it, because of rounding."""


def check_pitch(layers: Sequence[Layer], machine: Machine) -> None:
    """Refuse flat layers nearer to each other than the height of a strand of the machine.

    Curved layers are not checked, since their distance varies.
    """
    check_heights(np.sort([layer.plane.height for layer in flat_layers(layers)]), machine)


def check_heights(heights: FloatArray, machine: Machine) -> None:
    """Refuse ascending heights, mm, of flat layers that are nearer than the height of a strand."""
    if len(heights) < 2:
        return
    gaps, least = np.diff(heights), machine.strand_height
    k = int(gaps.argmin())
    if gaps[k] < least * (1.0 - _ROUNDING):
        raise InputError(
            f"layers must lie at least {least:.4g} mm apart, the height of a strand "
            f"(machine.fibre_height, or filament_area over fibre_width); got {gaps[k]:.4g} mm "
            f"between those at {heights[k]:.6g} and {heights[k + 1]:.6g} mm: use fewer layers"
        )


def read_once(slicer: object, folder: str, read: Callable[[], Content]) -> Content:
    """Read what a slicer takes of a folder, once for its check and the layers cut afterwards.

    Files that changed between are read again.
    """
    if not Path(folder).is_dir():
        return read()
    stats = [(file, file.stat()) for file in sorted(Path(folder).iterdir())]
    now = [(file, stat.st_mtime_ns, stat.st_size) for file, stat in stats]
    before, known = vars(slicer).pop("_read", (None, None))
    if before == now:
        return cast(Content, known)
    content = read()
    vars(slicer)["_read"] = now, content
    return content
