"""The part in space: how the page draws it, and what is dragged there."""

from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import unit_vector
from ccfem.cases.inspection.acting import finite
from ccfem.cases.part_draft import PartDraft
from ccfem.printing.bed_layout import bed_of

MATT = {"cast_shadow": False, "receive_shadow": False}
"""How everything is drawn: without shadows, which take most of the time."""


def draw_mesh(scene: Any, name: str, points: Any, triangles: Any, colour: Any, **more: Any) -> Any:
    """Draw triangles (t, 3) of points (n, 3), mm."""
    shape = points.astype(np.float32), triangles.astype(np.uint32)
    return scene.add_mesh_simple(name, *shape, color=colour, **MATT, **more)


def draw_label(scene: Any, name: str, text: str, place: Any, anchor: str = "bottom-center") -> Any:
    """Draw words of what has a name at a place (3,), mm."""
    return scene.add_label(f"{name}_said", text, position=tuple(place), anchor=anchor)


def draw_arrows(
    scene: Any, name: str, ends: FloatArray, colour: Any, head: float, slender: float
) -> Any:
    """Draw arrows (s, 2, 3), mm, from tail to tip: length of a head, and its radius over that."""
    return scene.add_arrows(
        name,
        ends.astype(np.float32),
        colour,
        shaft_radius=0.33 * slender * head,
        head_radius=slender * head,
        head_length=head,
    )


def draw_lines(
    scene: Any, name: str, ends: FloatArray, colour: Any, width: float = 1.5, unit: str = "screen"
) -> Any:
    """Draw straight pieces (s, 2, 3), mm, some pixels wide or, by unit "world", some mm.

    They have one colour, or each its own, (s, 3).
    """
    where = ends.astype(np.float32)
    if isinstance(colour, np.ndarray):
        colour = np.repeat(colour[:, None], 2, axis=1)
    return scene.add_line_segments(name, where, colour, thickness=width, thickness_units=unit)


def linear(colours: FloatArray) -> Any:
    """Colours (n, 3) as bytes of linear light, which viser takes them for, encoding them itself."""
    low = colours <= 0.04045
    light = np.where(low, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)


_SNAP = np.cos(np.radians(6.0))
"""Cosine of the angle to an axis within which a dragged direction takes that axis."""


# The direction of an arrow that is dragged.


def snapped(direction: FloatArray) -> FloatArray:
    """Return the unit vector along a direction, or along an axis that is within 6 degrees."""
    unit = direction / max(float(np.linalg.norm(direction)), 1e-300)
    axis = int(np.argmax(np.abs(unit)))
    if abs(unit[axis]) > _SNAP:
        return np.asarray(np.sign(unit[axis]) * np.eye(3)[axis])
    return np.asarray(unit)


def upward(draft: PartDraft) -> FloatArray | None:
    """Build direction (3,) of a part file, turned as it says; None where it says nothing right."""
    try:
        build = unit_vector(draft.content.get("build", "z"), "build").tolist()
        return np.array(bed_of(build, draft.content.get("bed", {}))[0])
    except InputError:  # the check says so
        return None


# Boxes that hold fibre, or none.


def boxes(draft: PartDraft) -> dict[int, FloatArray]:
    """Opposite corners (2, 3), mm, of the fibre regions of a part file that are boxes."""
    boxes_of = {}
    for k, region in draft.regions.items():
        if region.get("rule") == "box":
            corners = finite([region.get("lower"), region.get("upper")])
            if corners is not None and corners.shape == (2, 3):  # else the check says so
                boxes_of[k] = corners
    return boxes_of


def stretched(corners: FloatArray, end: int, place: FloatArray, body: FloatArray) -> FloatArray:
    """Corners of a box of which one is dragged to a place, or onto the bounds of the part near it.

    Parameters
    ----------
    corners : (2, 3) array, mm
    end : {0, 1}
        The lower or the upper corner; it does not pass the other.
    body : (2, 3) array, mm
        Bounds of the part.
    """
    reach = 0.05 * (body[1] - body[0])
    near = np.abs(body - place)
    bound = np.where(near[0] < near[1], body[0], body[1])
    place = np.where(near.min(axis=0) < reach, bound, np.round(place, 2))
    if end == 0:
        return np.stack([np.minimum(place, corners[1] - reach), corners[1]])
    return np.stack([corners[0], np.maximum(place, corners[0] + reach)])
