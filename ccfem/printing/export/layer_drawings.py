"""A flat layer as a drawing to scale, in mm: border, fibre and links, as SVG or DXF.

DXF is written as of release 12 (AutoCAD R12), which every program reads: polylines on the layers
BORDER, FIBRE and LINK.
"""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.whole import whole_file
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

_COLOURS = {"BORDER": 8, "FIBRE": 7, "LINK": 5}
"""Colours of the DXF layers by their AutoCAD number: grey, black or white, blue."""
_INKS = {"BORDER": "#5d6878", "FIBRE": "#1d2430", "LINK": "#4a8fd4"}
_MARGIN = 2.0
"""Space round an SVG drawing, mm."""

Line = tuple[str, FloatArray]


def draw_layer(paths: Toolpaths, layer: Layer, width: float, file: str | Path) -> None:
    """Draw one flat layer to a file, whole or not at all; its suffix says the format.

    Coordinates are those of the layer's plane, mm, as in `Plane.project`. Fibre is as wide in SVG
    as it is laid.

    Parameters
    ----------
    paths : Toolpaths
        Of the whole part, or of this layer.
    width : float, mm
        Of a strand.
    file : path
        ``.svg`` or ``.dxf``.
    """
    if layer.flat is None:
        raise InputError(
            f"layer {layer.index} is curved, and drawings are of flat ones: take paths.vtp"
        )
    writers = {".svg": _svg, ".dxf": _dxf}
    suffix = Path(file).suffix.lower()
    if suffix not in writers:
        raise InputError(f"a layer is drawn as .svg or .dxf; got '{file}': change the suffix")
    border = [layer.plane.points[np.append(loop, loop[:1])] for loop in layer.loops]
    lines = [("BORDER", line) for line in border] + list(_fibre(paths, layer))
    with whole_file(file) as temporary:
        temporary.write_text("\n".join(writers[suffix](lines, width)) + "\n", encoding="ascii")


def _fibre(paths: Toolpaths, layer: Layer) -> Iterator[Line]:
    """Strands and links of a layer, each in one piece."""
    mine = paths.select((paths.layer == layer.index) & (paths.kind == FIBRE))
    plane = layer.plane.project(mine.points)
    for start, end in pairwise(mine.offsets.tolist()):
        link = mine.link[start : end - 1]
        turns = [0, *(np.flatnonzero(np.diff(link)) + 1).tolist(), len(link)]
        for first, last in pairwise(turns):
            name = "LINK" if link[first] else "FIBRE"
            yield name, plane[start + first : start + last + 1]


def _svg(lines: list[Line], width: float) -> Iterator[str]:
    """Lines of an SVG file; y runs upwards in the plane and downwards in the file."""
    points = np.concatenate([np.zeros((0, 2)), *(line for _, line in lines)])
    low = points.min(axis=0, initial=0.0) if not len(points) else points.min(axis=0)
    size = (np.ptp(points, axis=0) if len(points) else np.zeros(2)) + 2.0 * _MARGIN
    corner = (low[0] - _MARGIN, -(low[1] - _MARGIN + size[1]))
    yield (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.4f}mm" '
        f'height="{size[1]:.4f}mm" viewBox="{corner[0]:.4f} {corner[1]:.4f} '
        f'{size[0]:.4f} {size[1]:.4f}" fill="none" stroke-linejoin="round">'
    )
    for name, ink in _INKS.items():
        thick = 0.2 if name == "BORDER" else width
        yield f'<g id="{name.lower()}" stroke="{ink}" stroke-width="{thick:g}">'
        for kind, line in lines:
            if kind == name:
                corners = " ".join(f"{x:.4f},{-y + 0.0:.4f}" for x, y in line.tolist())
                yield f'<polyline points="{corners}"/>'
        yield "</g>"
    yield "</svg>"


def _dxf(lines: list[Line], width: float) -> Iterator[str]:
    """Lines of a DXF file: group code and value by turns."""
    head = [(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009"), (0, "ENDSEC")]
    table = [(0, "SECTION"), (2, "TABLES"), (0, "TABLE"), (2, "LAYER"), (70, str(len(_COLOURS)))]
    for name, colour in _COLOURS.items():
        table += [(0, "LAYER"), (2, name), (70, "0"), (62, str(colour)), (6, "CONTINUOUS")]
    table += [(0, "ENDTAB"), (0, "ENDSEC")]
    groups = [*head, *table, (0, "SECTION"), (2, "ENTITIES")]
    for name, line in lines:
        groups += [(0, "POLYLINE"), (8, name), (66, "1"), (70, "0")]
        groups += [(10, "0.0"), (20, "0.0"), (30, "0.0")]
        for x, y in line.tolist():
            groups += [(0, "VERTEX"), (8, name), (10, f"{x:.6f}"), (20, f"{y:.6f}"), (30, "0.0")]
        groups += [(0, "SEQEND"), (8, name)]
    for code, value in [*groups, (0, "ENDSEC"), (0, "EOF")]:
        yield f"{code:>3}"
        yield value
