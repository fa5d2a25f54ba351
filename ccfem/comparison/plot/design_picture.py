"""Pictures of designs: densities with the outline of the part; a part in space by its surface."""

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from ccfem.comparison.plot.canvas import colour_bar, new_figure, scale_bar, title
from ccfem.comparison.plot.part_views import part_figure
from ccfem.fem.topopt.design import Design

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ccfem.body.mesh.tet_mesh import TetMesh

_OUTLINE = "#c0392b"
_SURFACE = "#9ec1e3"


def design_picture(design: Design, planform: Any, part: "TetMesh", heading: str) -> "Figure":
    """Draw a design.

    Parameters
    ----------
    design : Design
        Of tetrahedra.
    planform : shapely Polygon, mm, or None
        Outline of the part of a sheet; without it the surface of the part is drawn.
    part : TetMesh
        Of the part.
    """
    if planform is None:
        colour = [_SURFACE] * len(part.boundary)
        return part_figure(part.points, part.boundary, colour, (), title=heading)
    mesh = design.full.mesh
    points = mesh.points[:, :2]
    cells = np.sort(mesh.cells, axis=1)
    low = mesh.points[:, 2] < mesh.points[:, 2].mean()
    # Of the three tetrahedra of a prism, one has its three lower corners.
    base = np.flatnonzero(low[cells].sum(axis=1) == 3)
    triangles = cells[base][low[cells[base]]].reshape(-1, 3)
    low_, high = points.min(axis=0), points.max(axis=0)
    figure, (axes,) = new_figure((*low_, *high))
    shown = axes.tripcolor(
        *points.T, triangles, facecolors=design.density[base], cmap="Greys", vmin=0.0, vmax=1.0
    )
    for ring in (planform.exterior, *planform.interiors):
        axes.plot(*shapely.get_coordinates(ring).T, color=_OUTLINE, linewidth=0.8)
    colour_bar(axes, shown.cmap, (0.0, 1.0), "density")
    scale_bar(axes)
    title(axes, heading)
    return figure
