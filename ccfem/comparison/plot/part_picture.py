"""A part with its patches, loads and supports: a picture, and a page on which it turns."""

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.cases.inspection import Check
from ccfem.comparison.plot.colours import SECTION, rgb
from ccfem.comparison.plot.part_views import Arrow, Label, part_figure
from ccfem.comparison.plot.symbols import arrow_outside, spread
from ccfem.fem.elasticity.load_kinds import patches_of, points_of
from ccfem.geometry.facets import are_among

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = ("#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#8c7a00", "#d9a58c", "#9ec1e3", "#b9dccb")
_LOAD = "#b3261e"
_MARKS = 12
"""Symbols on a support."""


def part_picture(checked: Check) -> "Figure":
    """Draw a part from two sides: patches coloured and named, loads as arrows, supports marked.

    The arrows are the resultants of the loads, at their points of attack; a load without one has
    none. Triangles mark what is held, green lines where the part says that fibre lies.
    """
    mesh = checked.case.problem.mesh
    colours, labels = coloured(checked)
    title = checked.case.title
    return part_figure(
        mesh.points,
        mesh.boundary,
        colours,
        labels,
        load_arrows(checked),
        title,
        support_marks(checked),
        fibre_outlines(checked),
    )


def fibre_outlines(checked: Check) -> list[FloatArray]:
    """Borders of the layers and regions that get fibre, closed, where the part says which."""
    return [
        layer.points[np.append(loop, loop[0])] for layer in checked.fibre for loop in layer.loops
    ]


def coloured(checked: Check) -> tuple[list[str], list[Label]]:
    """Colour of each boundary facet, and the labels of the patches."""
    mesh = checked.case.problem.mesh
    colours = np.full(len(mesh.boundary), SECTION, dtype=object)
    labels = []
    middles = mesh.points[mesh.boundary].mean(axis=1)
    for k, row in enumerate(checked.patches):
        chosen = np.flatnonzero(are_among(mesh.boundary, mesh.patches[row.name]))
        if not len(chosen):
            continue
        if row.carries:
            colours[chosen] = _COLOURS[k % len(_COLOURS)]
        # At the facet nearest to the centre, of those that look one way outward.
        near = chosen[np.argmin(np.linalg.norm(middles[chosen] - row.centre, axis=1))]
        normal = row.normal if np.linalg.norm(row.normal) > 0.5 else np.zeros(3)
        if row.carries:
            labels.append(Label(row.name, middles[near], normal))
    return colours.tolist(), labels


def load_arrows(checked: Check, case: str | None = None) -> list[Arrow]:
    """Resultants of the loads; of one load case alone where that has loads of its own."""
    rows = [row for row in checked.loads if row.case == case]
    return [
        Arrow(row.point, row.resultant, _LOAD, f"{row.case}: {row.size:.4g} N")
        for row in rows or checked.loads
        if row.size > 0.0
    ]


def support_marks(checked: Check, case: str | None = None) -> FloatArray:
    """Places on what is held, in one load case or in any, spread evenly over its facets."""
    problem = checked.case.problem
    supports = problem.supports_of(case) if case in problem.cases else problem.all_supports
    marks: list[FloatArray] = []
    for support in supports:
        marks += [np.asarray(point, dtype=float)[None] for point in points_of(support)]
        for name in patches_of(support):
            facets = problem.mesh.patches.get(name, np.zeros((0, 3), dtype=np.int64))
            middles = problem.mesh.points[facets].mean(axis=1)
            middles = middles[np.lexsort(np.round(middles, 6).T)]
            marks.append(middles[spread(middles, _MARKS)])
    return np.concatenate([np.zeros((0, 3)), *marks])


def drawn_arrows(arrows: Sequence[Arrow], length: float, body: FloatArray) -> list[dict[str, Any]]:
    """Arrows as pages draw them, outside of a part: ``ends``, tail and tip, and ``text`` at ``at``.

    Parameters
    ----------
    length : float, mm
    body : (t, 3, 3) array, mm
        Corners of the triangles of the part.
    """
    drawn = []
    for arrow in arrows:
        ends, presses = arrow_outside(arrow.place, arrow.direction, length, body)
        free = ends[0 if presses else 1]
        drawn.append({"text": arrow.text, "ends": ends.tolist(), "at": free.tolist()})
    return drawn


def part_page(checked: Check) -> str:
    """Write a page, complete in itself, on which the part of `part_picture` turns."""
    mesh = checked.case.problem.mesh
    used, triangles = np.unique(mesh.boundary, return_inverse=True)
    colours, labels = coloured(checked)
    known = list(dict.fromkeys(colours))
    points = mesh.points[used]
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    data = {
        "points": points.round(3).tolist(),
        "triangles": triangles.reshape(-1, 3).tolist(),
        "colours": [rgb(name) for name in known],
        "colour": [known.index(name) for name in colours],
        "labels": [[label.text, label.place.round(3).tolist()] for label in labels],
        "marks": support_marks(checked).round(3).tolist(),
        "lines": [line.round(3).tolist() for line in fibre_outlines(checked)],
        "arrows": drawn_arrows(load_arrows(checked), size / 5.0, mesh.points[mesh.boundary[:, :3]]),
    }
    text = json.dumps(data, separators=(",", ":")).replace("</", "<\\/")
    page = Path(__file__).with_name("part_page.html").read_text(encoding="utf-8")
    return page.replace("@TITLE@", escape(checked.case.title)).replace("@DATA@", text)
