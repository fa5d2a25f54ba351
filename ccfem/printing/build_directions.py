"""Build directions of flat layers: how much of the tension fibre could take in each, and why not.

Flat layers hold fibre in their plane alone. Where the tension of a part runs across them, no
strategy makes it stiffer: it has to be printed along another direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.fem.elasticity.stress_field import PartStress
from ccfem.machine.machine import Machine
from ccfem.printing.bed_layout import turned
from ccfem.printing.support.overhang import overhang
from ccfem.slicing.layers.layer import plane_frame
from ccfem.slicing.layers.slicer import Vector

AXES: dict[str, Vector] = {
    "z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
    "y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
}
"""Directions that are looked at, by their names in a part file."""
_GAIN = 0.2
"""Share of the tension that another direction has to add to be proposed. Our choice."""
_ALIKE = 0.01
"""Share of the tension below which two directions differ by support and height alone."""
_TURNS = ("x=90", "x=-90", "y=90", "y=-90", "x=180")


@dataclass(frozen=True)
class BuildDirection:
    """What printing a part in flat layers along a direction means.

    Attributes
    ----------
    up : tuple of 3 floats
        In the frame of the mesh.
    tension : float
        Share of the tension in the part that lies in the plane of the layers (`tension_share`).
    height : float, mm
    layers : int
        Layers of matrix, as high as the machine lays them.
    in_air : float
        Share of the matrix that would be laid in air without support.
    """

    up: Vector
    tension: float
    height: float
    layers: int
    in_air: float

    @property
    def hanging(self) -> str:
        """What is laid in air, in words."""
        return f"{self.in_air:.1%} of the matrix laid in air" if self.in_air else "nothing in air"

    @classmethod
    def of(cls, stress: PartStress, up: Vector, machine: Machine) -> "BuildDirection":
        """Look at a part along a direction."""
        hanging = overhang(stress.mesh, up, machine)
        height = float(_box(stress, up)[2])
        layers = int(np.ceil(height / machine.highest_matrix(0.0)))
        in_air = 0.0 if hanging is None else hanging.share
        return cls(up, tension_share(stress, up), height, layers, in_air)


def tension_share(stress: PartStress, up: Sequence[float]) -> float:
    """Share of the tension in a part that flat layers hold: 1 where all of it lies in their plane.

    The largest tension in the plane across `up` over the largest one in space, each summed over the
    volume; 0 where there is no tension.
    """
    tensor, volume = stress.stress, stress.mesh.volumes
    most = np.maximum(np.linalg.eigvalsh(tensor)[:, -1], 0.0)
    held, _, _ = largest_in_plane(in_plane(tensor, plane_frame(up)))
    whole = float(volume @ most)
    return float(volume @ np.maximum(held, 0.0)) / whole if whole > 0.0 else 0.0


def _box(stress: PartStress, up: Sequence[float]) -> FloatArray:
    """Sides of the part's box on the bed, (3,), mm."""
    corners = stress.mesh.points[np.unique(stress.mesh.corners)] @ plane_frame(up).T
    return np.asarray(np.ptp(corners, axis=0))


def better_direction(stress: PartStress, build: Vector, machine: Machine) -> str:
    """Propose the direction whose layers let fibre take much more of the tension, with reasons.

    Of directions along the axes whose box fits on the bed the one of most tension in its layers; of
    those alike in it the one that lays least in air, and then the lowest. Empty where none adds a
    fifth of the tension.
    """
    now = tension_share(stress, build)
    shares = {
        name: tension_share(stress, up)
        for name, up in AXES.items()
        if (_box(stress, up) <= np.array(machine.gcode.bed)).all()
    }
    most = max(shares.values(), default=0.0)
    if most < now + _GAIN:
        return ""
    looked_at = {
        name: BuildDirection.of(stress, AXES[name], machine)
        for name, share in shares.items()
        if share > most - _ALIKE
    }
    name, best = min(looked_at.items(), key=lambda item: (item[1].in_air, item[1].height))
    here = BuildDirection.of(stress, build, machine)
    return (
        f"layers along {name} would let fibre take {best.tension:.0%} of the tension (now "
        f"{here.tension:.0%}), {best.height:.4g} mm high in {best.layers} layers (now "
        f"{here.height:.4g} mm in {here.layers}), with {best.hanging} without support (now "
        f'{here.hanging}): build = "{name}"{_option(build, best.up)}'
    )


def _option(build: Vector, up: Vector) -> str:
    """Say which option turns a part from one direction to another, where one turn does."""
    for text in _TURNS:
        if np.abs(np.array(turned(build, [text])[0]) - up).max() < 1e-9:
            return f", or --turn {text}"
    return ""
