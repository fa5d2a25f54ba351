"""The part as the report draws it: patches, loads, supports, and how it deforms."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.cases.inspection import Check
from ccfem.comparison.plot.part_picture import coloured, load_arrows, support_marks
from ccfem.comparison.report.packing import Rounded, as_bytes
from ccfem.fem.elasticity.stress_field import StressField

_FACETS = 16_000
"""Facets that are drawn; a part with more is drawn coarser."""
_SHOWN = 0.06
"""Largest displacement that is drawn, over the size of the part, at the scale that is proposed."""


def part_view(checked: Check, stress: StressField) -> dict[str, Any]:
    """Return what the page draws of a part.

    Parameters
    ----------
    checked : Check
    stress : StressField
        Of the load case that counts.

    Returns
    -------
    dict
        A tree for `ccfem.comparison.report.packing.pack`.
    """
    mesh = checked.case.problem.mesh
    colours, labels = coloured(checked)
    known = list(dict.fromkeys(colours))
    shade = np.array([known.index(colour) for colour in colours], dtype=np.uint8)
    used, triangles = np.unique(mesh.boundary[:, :3], return_inverse=True)
    points = mesh.points[used]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    # The corners of quadratic cells come before the middles of their edges.
    same = np.array_equal(stress.mesh.points[: len(mesh.points)], mesh.points)
    moved = stress.displacement[used] if same else None
    kept, triangles, drawn = _coarser(points, triangles.reshape(-1, 3), shade, size)
    found = {
        "points": Rounded(points[kept], 1e-4 * size),
        "triangles": triangles,
        "colours": known,
        "colour": drawn,
        "size": size,
        "labels": [{"text": label.text, "at": label.place.tolist()} for label in labels],
        "supports": support_marks(checked, stress.case).tolist(),
        "arrows": [
            {"text": arrow.text, "at": arrow.place.tolist(), "along": _unit(arrow.direction)}
            for arrow in load_arrows(checked, stress.case)
        ],
        "coarser": len(kept) < len(points),
    }
    if moved is not None:
        most = float(np.linalg.norm(stress.displacement, axis=1).max(initial=0.0))
        found |= {
            "moved": Rounded(moved[kept], max(most, 1e-300) / 2000.0),
            "moved_size": as_bytes(np.linalg.norm(moved[kept], axis=1), most),
            "most": most,
            "scale": _round_scale(_SHOWN * size / most) if most > 0.0 else 1.0,
        }
    return found


def _unit(direction: FloatArray) -> list[float]:
    return [float(x) for x in direction / max(float(np.linalg.norm(direction)), 1e-300)]


def _round_scale(scale: float) -> float:
    """Largest of 1, 2, 5 times a power of ten that is at most `scale`."""
    power = 10.0 ** np.floor(np.log10(scale))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= scale * 1.0001))


def _coarser(
    points: FloatArray, triangles: IntArray, shade: NDArray[np.uint8], size: float
) -> tuple[IntArray, IntArray, NDArray[np.uint8]]:
    """Merge points that share a cell of a grid until few enough facets are left.

    Returns the points that stay, and the facets and their colours.
    """
    if len(triangles) <= _FACETS:
        return np.arange(len(points)), triangles, shade
    side = size / 120.0
    while True:
        _, first, number = np.unique(
            np.floor(points / side).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        merged = number.reshape(-1)[triangles]
        whole = np.all(merged != np.roll(merged, 1, axis=1), axis=1)
        if whole.sum() <= _FACETS:
            return first, merged[whole], shade[whole]
        side *= 1.25
