"""What values show of themselves: `figure` in the plane, `page` in a notebook, `show` in space."""

import base64
import io
from collections.abc import Sequence
from functools import singledispatch
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import von_mises
from ccfem.body.mesh.check import about_slivers
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.inspection.part_check import Check, check
from ccfem.comparison.plot.canvas import extents_of, new_figure, png, scale_bar, title
from ccfem.comparison.plot.colours import INK, SECTION, scale
from ccfem.comparison.plot.curves import axes_below, legend_below
from ccfem.comparison.plot.fields import tension_picture
from ccfem.comparison.plot.part_picture import part_picture
from ccfem.comparison.plot.part_views import part_figure
from ccfem.comparison.plot.paths import draw_section
from ccfem.comparison.plot.scenes import show as show
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.evaluation.evaluation import Evaluation
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.paths.fields.chart import flat_view
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SMALL = 80.0
"""Resolution of the picture in a notebook, dots per inch."""
_PATCHES = ("#56b4e9", "#e69f00", "#009e73", "#cc79a7", "#8c7a00", "#d9a58c", "#9ec1e3", "#b9dccb")


@singledispatch
def figure(value: Any, **options: Any) -> "Figure":
    """Draw a value in the plane."""
    raise InputError(f"a {type(value).__name__} has no picture: print it")


@figure.register
def _(value: Check) -> Any:
    return part_picture(value)


@figure.register
def _(value: Case) -> Any:
    return part_picture(check(value))


@figure.register
def _(value: Problem) -> Any:
    return part_picture(check(Case("problem", "", value)))


@figure.register
def _(value: TetMesh) -> Any:
    colours = np.full(len(value.boundary), SECTION, dtype=object)
    rows = {tuple(sorted(facet)): k for k, facet in enumerate(value.boundary.tolist())}
    for number, name in enumerate(sorted(value.patches)):
        facets = value.patches[name]
        chosen = [rows[key] for key in map(tuple, np.sort(facets, axis=1).tolist()) if key in rows]
        colours[chosen] = _PATCHES[number % len(_PATCHES)]
    return part_figure(value.points, value.boundary, colours.tolist(), [])


@figure.register
def _(value: StressField) -> Any:
    mesh, stress = value.mesh, von_mises(value.nodal)
    of_triangle = stress[mesh.boundary].mean(axis=1)
    end = float(np.quantile(of_triangle, 0.98)) or 1.0
    heading = f"von Mises stress, {value.case}: darkest from {end:.3g} MPa on"
    return part_figure(mesh.points, mesh.boundary, _shades(of_triangle / end), [], title=heading)


def _shades(share: FloatArray) -> Sequence[str]:
    """Colours "#rrggbb" of shares of the largest value."""
    from matplotlib.colors import to_hex

    return [to_hex(colour) for colour in scale("stress")(np.clip(share, 0.0, 1.0))]


@figure.register
def _(value: Layer) -> Any:
    view = flat_view(value)
    found, (axes,) = new_figure(extents_of(view.plane.points))
    draw_section(axes, view)
    scale_bar(axes)
    title(axes, f"layer {value.index}", f"{value.areas.sum():.4g} mm^2")
    return found


@figure.register
def _(value: LayerStress) -> Any:
    return tension_picture(value, f"tension in layer {value.layer.index}", "size and direction")


@figure.register
def _(value: Toolpaths, layer: int | None = None) -> Any:
    """Draw the fibre of one layer, by default of the one with the most of it."""
    fibre = value.of_kind(FIBRE)
    if not len(fibre):
        raise InputError("there is no fibre to draw: plan some, with ccfem.plan")
    known = np.unique(fibre.layer)
    if layer is None:
        most = [float(fibre.on_layer(int(k)).lengths.sum()) for k in known]
        layer = int(known[int(np.argmax(most))])
    elif layer not in known:
        raise InputError(
            f"layer {layer} has no fibre; layers with fibre are: {', '.join(map(str, known))}"
        )
    return _paths_figure(fibre.on_layer(layer), layer)


def _paths_figure(paths: Toolpaths, layer: int) -> "Figure":
    """Draw paths along the mean direction of their normals."""
    from matplotlib.collections import LineCollection

    normal = paths.normals.mean(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    across = [k for k in range(3) if k != axis]
    lines = [path[:, across] for path in paths]
    figure, (axes,) = new_figure(extents_of(np.concatenate(lines)))
    axes.add_collection(LineCollection(lines, colors=INK, linewidths=0.8))
    scale_bar(axes)
    title(axes, f"layer {layer}", f"{len(paths)} paths, {paths.lengths.sum():.0f} mm of fibre")
    return figure


@figure.register
def _(value: Evaluation, columns: Sequence[str] = ("efficiency", "coverage")) -> Any:
    """Draw indices over the layers."""
    for name in columns:
        if name not in value.values:
            raise InputError(f"there is no index '{name}'; there are: {', '.join(value.values)}")
    found, axes = axes_below("", "layer", "index")
    colours = dict(zip(columns, _PATCHES, strict=False))
    for name in columns:
        axes.plot(value.layers, value.values[name][:-1], "o-", ms=3.0, color=colours[name])
    axes.set_ylim(bottom=0.0, auto=True)
    axes.autoscale(axis="y")
    legend_below(axes, colours, list(columns))
    return found


@figure.register
def _(value: VirtualTest) -> Any:
    return figure(value.solution)


def page(value: Any) -> str:
    """Write what a notebook shows: a line, what is wrong with its cure, and a picture."""
    lines = [f"<p>{escape(repr(value))}</p>"]
    lines += [f"<p><b>{escape(line)}</b></p>" for line in _wrong(value)]
    if not isinstance(value, Toolpaths) or len(value.of_kind(FIBRE)):
        lines.append(image(figure(value)))
    return "\n".join(lines)


def image(drawn: "Figure") -> str:
    """Write a figure as an image of HTML, small, without the empty room round it."""
    from PIL import Image, ImageChops

    picture = Image.open(io.BytesIO(png(drawn, _SMALL))).convert("RGB")
    room = ImageChops.difference(picture, Image.new("RGB", picture.size, "white")).getbbox()
    target = io.BytesIO()
    picture.crop(room).quantize(64).save(target, "png")
    data = base64.b64encode(target.getvalue()).decode()
    return f'<img alt="" style="max-width:100%" src="data:image/png;base64,{data}">'


def _wrong(value: Any) -> Sequence[str]:
    """Say what is wrong with a value, or may not be meant, and what to do about it."""
    if isinstance(value, Problem):
        value = Case("problem", "", value)
    if isinstance(value, Case):
        checked = check(value)
        return (*checked.mistakes, *checked.warnings)
    if isinstance(value, StressField):
        return value.findings
    if isinstance(value, VirtualTest):
        return value.solution.findings
    if isinstance(value, TetMesh):
        return [line for line in [about_slivers(value)] if line]
    if isinstance(value, Toolpaths) and not len(value.of_kind(FIBRE)):
        return ["no fibre: the layers, or their areas in tension, may be too small"]
    return ()
