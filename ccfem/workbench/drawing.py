"""How the page draws things in space."""

from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray

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
