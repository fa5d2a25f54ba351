"""Picture of the shape of a part: its surface in grey, from several sides."""

import io
from collections.abc import Sequence

import numpy as np

from ccfem.errors import InputError
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.plot.colours import OUTLINE
from ccfem.plot.part3d import surface_polydata

__all__ = ["VIEWS", "shape_picture"]

VIEWS = ((1.0, 0.9, 0.8), (0.9, -0.8, -0.8), (-0.8, 0.9, 0.9))
"""Directions from the part to the eye."""


def shape_picture(
    mesh: TetMesh,
    views: Sequence[tuple[float, float, float]] = VIEWS,
    up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    size: tuple[int, int] = (700, 700),
) -> bytes:
    """Picture of the surface of a part, the views side by side.

    Parameters
    ----------
    mesh : TetMesh
    views : sequence of tuples of 3 floats
        From the part to the eye.
    up : tuple of 3 floats, default y
        Direction that points up in the picture.
    size : tuple of 2 ints, pixels
        Of each view.

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

    surface = surface_polydata(mesh)
    rim = surface.extract_feature_edges(
        feature_angle=50.0, boundary_edges=False, manifold_edges=False
    )
    middle = mesh.bounds.mean(axis=0)
    reach = 3.0 * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    with pv.vtk_verbosity("off"):
        plotter = pv.Plotter(
            off_screen=True,
            shape=(1, len(views)),
            window_size=[size[0] * len(views), size[1]],
            border=False,
        )
        try:
            if not plotter.render_window.SupportsOpenGL():
                raise InputError(
                    "pictures in space need OpenGL, which this machine lacks: install Mesa (libgl1 "
                    "or libosmesa6)"
                )
            for k, view in enumerate(views):
                plotter.subplot(0, k)
                plotter.set_background("white")
                plotter.add_mesh(surface, color="#c3cedb", smooth_shading=False)
                if rim.n_cells:
                    plotter.add_mesh(rim, color=OUTLINE, line_width=1.0)
                away = np.array(view) / np.linalg.norm(view)
                plotter.camera_position = [tuple(middle + reach * away), tuple(middle), up]
                plotter.reset_camera()
            plotter.enable_anti_aliasing("ssaa")
            image = plotter.screenshot(None, return_img=True)
        finally:
            plotter.close()
    target = io.BytesIO()
    Image.fromarray(image).save(target, "png")
    return target.getvalue()
