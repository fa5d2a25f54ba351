"""Values in space, by PyVista: in a window, in a notebook, or else as a picture."""

import os
import sys
from dataclasses import dataclass
from functools import singledispatch
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import von_mises
from ccfem.base.whole import check_writable, whole_file
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.inspection.part_check import Check
from ccfem.comparison.plot.colours import SECTION
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

_PATCHES = ("#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#8c7a00", "#d9a58c", "#9ec1e3", "#b9dccb")
_SHARE = 0.05
"""Largest displacement in a view, as a share of the part's size."""


@dataclass(frozen=True)
class View:
    """A picture of a scene, (h, w, 3) bytes; a notebook shows it."""

    image: Any

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        return f"View of {width} x {height} pixels"

    def _repr_png_(self) -> bytes:
        import io

        from PIL import Image

        target = io.BytesIO()
        Image.fromarray(np.asarray(self.image, dtype=np.uint8)).save(target, "png")
        return target.getvalue()


def show(value: Any, picture: str | Path | None = None, **options: Any) -> View | None:
    """Show a value in space.

    Parameters
    ----------
    value : mesh, problem, case, stress, layer, paths, or a sequence of these
    picture : path, optional
        Write the view to a file (.png) instead.
    **options
        ``scale`` of the displacement of a stress field.

    Returns
    -------
    View or None
        The picture, where it was written or no window can be opened.
    """
    if picture is not None and Path(picture).suffix.lower() != ".png":
        raise InputError(f"a view is written as .png; got '{Path(picture).name}': rename it")
    if picture is not None:
        check_writable(picture)
    import pyvista

    notebook = "ipykernel" in sys.modules and find_spec("trame") is not None
    window = pyvista.OFF_SCREEN is False and _has_screen()
    alone = picture is not None or not (notebook or window)
    plotter = pyvista.Plotter(off_screen=alone, window_size=(900, 650))
    for item in value if isinstance(value, tuple | list) else (value,):
        add(item, plotter, **options)
    plotter.add_axes()
    if not alone:
        plotter.show()
        return None
    view = View(plotter.screenshot(return_img=True))
    plotter.close()
    if picture is not None:
        with whole_file(picture) as temporary:
            temporary.write_bytes(view._repr_png_())
    return view


def _has_screen() -> bool:
    """Whether a window can be opened."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


@singledispatch
def add(value: Any, plotter: Any, **options: Any) -> None:
    """Add a value to a scene."""
    raise InputError(f"a {type(value).__name__} is nothing in space: use plot() or print it")


@add.register
def _(value: TetMesh, plotter: Any) -> None:
    plotter.add_mesh(_surface(value.points, value.boundary), color=SECTION, show_edges=True)
    for k, (name, facets) in enumerate(sorted(value.patches.items())):
        if len(facets):
            surface, colour = _surface(value.points, facets), _PATCHES[k % len(_PATCHES)]
            plotter.add_mesh(surface, color=colour, label=name)
    if value.patches:
        plotter.add_legend(bcolor=None, face="rectangle")


@add.register
def _(value: Problem, plotter: Any) -> None:
    add(value.mesh, plotter)


@add.register
def _(value: Case, plotter: Any) -> None:
    add(value.problem.mesh, plotter)


@add.register
def _(value: Check, plotter: Any) -> None:
    mesh = value.case.problem.mesh
    size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    add(mesh, plotter)
    for row in value.loads:
        if row.size > 0.0:
            along = row.resultant / row.size
            plotter.add_arrows(row.point, along, mag=size / 6.0, color="red")


@add.register
def _(value: StressField, plotter: Any, scale: float | None = None) -> None:
    mesh, moved = value.mesh, value.displacement
    most = float(np.linalg.norm(moved, axis=1).max())
    size = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    if scale is None:
        scale = _SHARE * size / most if most > 0.0 else 0.0
    surface = _surface(mesh.points + scale * moved, mesh.boundary)
    stress = von_mises(value.nodal)
    title = f"von Mises, MPa; displacement x {scale:.3g}"
    limits = (0.0, float(np.quantile(stress, 0.995)))
    plotter.add_mesh(surface, scalars=stress, clim=limits, scalar_bar_args={"title": f"{title}\n"})


@add.register
def _(value: VirtualTest, plotter: Any, scale: float | None = None) -> None:
    add(value.solution, plotter, scale=scale)


@add.register
def _(value: Layer, plotter: Any) -> None:
    plotter.add_mesh(_surface(value.points, value.triangles), color=SECTION, opacity=0.6)


@add.register
def _(value: Toolpaths, plotter: Any) -> None:
    import pyvista

    fibre = value.of_kind(FIBRE)
    if not len(fibre):
        raise InputError("there is no fibre to show: plan some, with ccfem.plan")
    counts = np.diff(fibre.offsets)
    lines = np.insert(np.arange(len(fibre.points)), fibre.offsets[:-1], counts)
    data = pyvista.PolyData(np.array(fibre.points), lines=lines)
    data.cell_data["layer"] = np.array(fibre.layer)
    known = np.unique(fibre.layer)
    bar = {"title": "layer\n", "fmt": "%.0f", "n_labels": min(len(known), 5)}
    plotter.add_mesh(data, scalars="layer", line_width=2.0, scalar_bar_args=bar)


def _surface(points: FloatArray, triangles: IntArray) -> Any:
    """Triangles as PyVista takes them."""
    import pyvista

    return pyvista.PolyData.from_regular_faces(np.array(points), np.array(triangles))
