"""The paper's figures 1 to 6 and 8, with our parts; figure 7 is in `fiso_shapes`."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh import box_mesh
from ccfem.comparison.plot.canvas import png
from ccfem.geometry.polylines import resample
from ccfem.papers.panels import canvas
from ccfem.slicing.guidance.height_field import height_field
from ccfem.slicing.guidance.normal_field import normal_field
from ccfem.slicing.guidance.stress_regions import StressRegions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ccfem.papers.kipping_2023.chain import Chain

_MOST = 4000
"""Points or arrows that are drawn."""


def _space_axes(figure: "Figure", place: int, title: str, points: FloatArray) -> Any:
    axes = figure.add_subplot(1, 3, place, projection="3d")
    axes.set_title(title, y=0.9)
    axes.set_box_aspect(np.ptp(points, axis=0), zoom=1.3)
    axes.view_init(20.0, -60.0)
    axes.set_axis_off()
    return axes


def _thinned(chosen: IntArray) -> IntArray:
    return chosen[:: max(len(chosen) // _MOST, 1)]


def part_figures(name: str, run: "Chain") -> dict[str, bytes]:
    """Figures of a part by file: 1 and 2 regions, 4 field, 5 layers, 6 support, 8 paths."""
    mesh, sliced = run.stress.mesh, run.sliced
    centre = mesh.centres
    inside = _thinned(np.flatnonzero(sliced.regions.region >= 0))
    least = np.linalg.eigh(run.stress.stress[inside])[1][:, :, 0]
    pictures = {}
    figure = canvas(18.0, 6.0, layout="tight")
    axes = _space_axes(figure, 1, "critical regions", mesh.points)
    axes.scatter(*centre[inside].T, c=sliced.regions.region[inside], s=3, cmap="tab10")
    for place, title, arrows in (
        (2, "least principal direction", least),
        (3, "smoothed, of one sense", sliced.normals.direction[inside]),
    ):
        axes = _space_axes(figure, place, title, mesh.points)
        axes.quiver(*centre[inside].T, *arrows.T, length=2.0, lw=0.5)
    pictures[f"figure_2_{name}.png"] = png(figure)
    figure = canvas(18.0, 6.0, layout="tight")
    every = _thinned(np.arange(len(centre)))
    axes = _space_axes(figure, 1, "vectors in the whole part", mesh.points)
    axes.quiver(*centre[every].T, *sliced.normals.direction[every].T, length=2.0, lw=0.5)
    axes = _space_axes(figure, 2, "field", mesh.points)
    nodes = _thinned(np.unique(mesh.boundary))
    axes.scatter(*mesh.points[nodes].T, c=sliced.field.values[nodes], s=4, cmap="viridis")
    axes = _space_axes(figure, 3, "every tenth layer", mesh.points)
    for layer in sliced.layers[::10]:
        axes.plot_trisurf(*layer.points.T, triangles=layer.triangles, lw=0.0, alpha=0.8)
    pictures[f"figure_4_5_{name}.png"] = png(figure)
    figure = canvas(18.0, 6.0, layout="tight")
    both = np.concatenate([mesh.points, run.support.columns.mesh.points])
    axes = _space_axes(figure, 1, "every sixth layer, and every third of the support", both)
    for layer in run.support.layers[::3]:
        axes.plot_trisurf(*layer.points.T, triangles=layer.triangles, lw=0.0, color="C1")
    for layer in sliced.layers[::6]:
        axes.plot_trisurf(*layer.points.T, triangles=layer.triangles, lw=0.0, color="C0")
    for place, share in ((2, 0.35), (3, 0.7)):
        with_paths = np.unique(run.paths.layer)
        layer = sliced.layers[int(with_paths[int(share * len(with_paths))])]
        paths = run.paths.on_layer(layer.index)
        axes = _space_axes(figure, place, f"layer {layer.index}", layer.points)
        if len(paths):
            points, offsets = resample(paths.points, paths.offsets, 0.3)
            for line in np.split(points, offsets[1:-1]):
                axes.plot(*line.T, lw=0.6)
    pictures[f"figure_6_8_{name}.png"] = png(figure)
    return pictures


def senses_figure() -> tuple[bytes, float, float]:
    """Figures 1 and 3 on a cube: the same field, and energy, whatever the sense of a region."""
    mesh = box_mesh((10.0, 10.0, 10.0), (8, 8, 8))
    centre = mesh.centres
    tilt = np.radians(20.0)
    region = np.full(len(centre), -1)
    region[centre[:, 0] < 3.0], region[centre[:, 0] > 7.0] = 0, 1
    direction = np.zeros((len(centre), 3))
    direction[region == 0] = (np.sin(tilt), 0.0, np.cos(tilt))
    direction[region == 1] = (-np.sin(tilt), 0.0, np.cos(tilt))
    up = np.array([0.0, 0.0, 1.0])
    figure, energies = canvas(18.0, 6.0, layout="tight"), []
    middle = np.abs(centre[:, 1] - 5.0) < 0.7
    for place, sense in ((1, 1.0), (2, -1.0)):
        turned = direction * np.where(region == 1, sense, 1.0)[:, None]
        regions = StressRegions(region >= 0, region, turned, np.ones(len(centre)))
        normals = normal_field(mesh, regions, up)
        energies.append(normals.energy)
        axes = _space_axes(figure, place, f"field, one region given with {sense:+.0f}", mesh.points)
        axes.quiver(*centre[middle].T, *normals.direction[middle].T, length=0.8, lw=0.6)
        if sense > 0.0:
            values = height_field(mesh, normals.direction).values
            axes = _space_axes(figure, 3, "field", mesh.points)
            axes.scatter(*mesh.points.T, c=values, s=12)
    return png(figure), energies[0], energies[1]
