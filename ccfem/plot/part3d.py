"""Pictures of a whole part in space: its surface with the stress, and the fibre paths in it."""

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.plot.colours import INK, OUTLINE, scale
from ccfem.tensor import principal
from ccfem.toolpaths import Toolpaths

if TYPE_CHECKING:
    import pyvista as pv

__all__ = ["part_picture", "paths_polydata", "surface_polydata"]


def paths_polydata(toolpaths: Toolpaths, values: FloatArray | None = None) -> "pv.PolyData":
    """Toolpaths as polylines of PyVista.

    Parameters
    ----------
    toolpaths : Toolpaths
    values : (P,) array, optional
        Point data "values".

    Returns
    -------
    pyvista.PolyData
        One polyline a path, with the cell data "layer" and "kind".
    """
    import pyvista as pv

    sizes = np.diff(toolpaths.offsets)
    lines = np.insert(np.arange(len(toolpaths.points)), toolpaths.offsets[:-1], sizes)
    data = pv.PolyData(np.array(toolpaths.points), lines=lines)
    data.cell_data["layer"] = toolpaths.layer
    data.cell_data["kind"] = toolpaths.kind
    if values is not None:
        data.point_data["values"] = values
    return data


def surface_polydata(mesh: TetMesh, nodal: FloatArray | None = None) -> "pv.PolyData":
    """Boundary of a mesh as triangles of PyVista.

    Parameters
    ----------
    mesh : TetMesh
    nodal : (n, 3, 3) array, MPa, optional
        Stress at the nodes; gives the point data "tension", the largest principal stress where
        positive.
    """
    import pyvista as pv

    nodes, corners = np.unique(mesh.boundary, return_inverse=True)
    faces = np.insert(corners.reshape(-1, 3), 0, 3, axis=1).ravel()
    data = pv.PolyData(mesh.points[nodes], faces)
    if nodal is not None:
        largest = principal(nodal[nodes])[0][:, 0]
        data.point_data["tension"] = np.maximum(largest, 0.0)
    return data


def part_picture(
    stress: StressField,
    toolpaths: Toolpaths,
    values: FloatArray | None = None,
    label: str = "",
    build: tuple[float, float, float] = (0.0, 0.0, 1.0),
    colour: str = INK,
    size: tuple[int, int] = (1400, 1000),
) -> bytes:
    """Picture of a part: its far walls coloured by the tension, and the paths in front of them.

    Parameters
    ----------
    stress : StressField
    toolpaths : Toolpaths
    values : (P,) array, optional
        Values at the points of the paths, to colour them by.
    label : str
        Quantity and unit of `values`.
    build : tuple of 3 floats, default z
        Direction that points up in the picture.
    colour : str
        Of the paths where there are no values.
    size : tuple of 2 ints, pixels

    Returns
    -------
    bytes
        A PNG file.

    Raises
    ------
    InputError
        Where nothing can be rendered in space: no OpenGL.
    """
    import pyvista as pv
    from PIL import Image

    surface = surface_polydata(stress.mesh, stress.nodal)
    tension = surface.point_data["tension"]
    bars: dict[str, Any] = {
        "color": INK,
        "n_labels": 2,
        "fmt": "%.3g",
        "width": 0.24,
        "height": 0.06,
    }
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(off_screen=True, window_size=list(size))
        try:
            if not plotter.render_window.SupportsOpenGL():
                raise InputError(
                    "pictures in space need OpenGL, which this machine lacks: install Mesa (libgl1 "
                    "or libosmesa6), or use the pictures of layers"
                )
            plotter.set_background("white")
            plotter.add_mesh(
                surface,
                scalars="tension",
                cmap=scale("stress"),
                clim=(0.0, max(float(np.quantile(tension, 0.98)), 1e-12)),
                culling="front",
                lighting=False,
                scalar_bar_args={"title": "MPa tension", "position_x": 0.73, **bars},
            )
            rim = surface.extract_feature_edges(
                feature_angle=40.0, boundary_edges=False, manifold_edges=False
            )
            if rim.n_cells:
                plotter.add_mesh(rim, color=OUTLINE, line_width=1.5)
            if len(toolpaths):
                coloured = {} if values is None else {"scalars": "values", "cmap": scale("size")}
                plotter.add_mesh(
                    paths_polydata(toolpaths, values),
                    color=colour if values is None else None,
                    line_width=1.5,
                    scalar_bar_args={"title": label, "position_x": 0.04, **bars},
                    **coloured,
                )
            plotter.enable_anti_aliasing("ssaa")
            _look(plotter, stress.mesh, np.asarray(build, dtype=np.float64))
            image = plotter.screenshot(None, return_img=True)
        finally:
            plotter.close()
    target = io.BytesIO()
    Image.fromarray(image).save(target, "png")
    return target.getvalue()


def _look(plotter: Any, mesh: TetMesh, build: FloatArray) -> None:
    """Point the camera at the part, from above and a little to the side of its longer extent."""
    up = build / np.linalg.norm(build)
    extent = np.ptp(mesh.points, axis=0) * (1.0 - np.abs(up))
    along = np.zeros(3)
    along[int(np.argmax(extent))] = 1.0
    along -= (along @ up) * up
    along /= np.linalg.norm(along)
    middle = mesh.bounds.mean(axis=0)
    distance = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    away = 1.1 * up - 0.75 * np.cross(up, along) + 0.25 * along
    plotter.camera_position = [tuple(middle + 2.0 * distance * away), tuple(middle), tuple(up)]
    plotter.reset_camera()
    plotter.camera.zoom(1.45)
