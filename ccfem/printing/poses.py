"""Direction of a head on curved layers: along their normal, as far as the machine can tilt."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.machine.machine import Machine

_UP = np.array([0.0, 0.0, 1.0])


def poses(normals: FloatArray, build: FloatArray, machine: Machine) -> FloatArray:
    """Axes (n, 3) of the head above points with these normals: upright with three axes."""
    if machine.kinematics.kind == "three_axes":
        return np.tile(build, (len(normals), 1))
    return limited_tilt(normals, machine.kinematics.tilt_limit, build)


def limited_tilt(normals: FloatArray, limit: float, build: FloatArray = _UP) -> FloatArray:
    """Rotate directions (n, 3) that tilt from the build direction by more than a limit, degrees."""
    along = normals @ build
    aside = normals - along[:, None] * build
    size = np.linalg.norm(aside, axis=1)
    most = np.minimum(np.arctan2(size, along), np.radians(limit))
    aside /= np.maximum(size, 1e-300)[:, None]
    return np.asarray(aside * np.sin(most)[:, None] + np.cos(most)[:, None] * build)


def under_bed(tips: FloatArray, axes: FloatArray, machine: Machine) -> BoolArray:
    """Mask (n,) of tilted heads whose side reaches below the bed, the plane z = 0."""
    half = np.radians(machine.head_angle)
    lean = np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])
    side = machine.head_length / np.cos(half) * np.cos(np.minimum(lean + half, np.pi))
    return np.asarray(tips[:, 2] + side < 0.0)
