"""Given paths are judged as those of strategies: the same numbers, wherever the paths come from."""

from dataclasses import replace

import numpy as np
import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.comparison.request import Request
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.paths.planning import GivenPaths
from ccfem.printing.export.path_table import read_paths
from ccfem.slicing.slicers.planar import Planar
from ccfem.slicing.slicers.surfaces import Surfaces
from ccfem.strategies import create


@pytest.fixture(scope="module")
def bar():
    return ccfem.read("bar", element_size=5.0)


@pytest.fixture(scope="module")
def planned(bar):
    return ccfem.compare(bar, ["concentric", "zigzag"], layers=[1.0, 2.0, 4.0])


def test_paths_read_back_have_the_numbers_of_the_strategy(bar, planned):
    run = planned.runs[1]
    given = GivenPaths(run.toolpaths, "zigzag of before")
    judged = ccfem.compare(bar, {"given": given, "zigzag": create("zigzag")})
    # no layers were asked for: they are those of the paths
    assert [layer.plane.height for layer in judged.layers] == pytest.approx([1.0, 2.0, 4.0])
    mine, again = judged.runs
    assert mine.note == "given, so all are compared at this length"
    assert mine.length_per_layer == pytest.approx(judged.fibre_per_layer)
    assert again.length_per_layer == pytest.approx(mine.length_per_layer, rel=0.02)
    for name, value in run.evaluation.total.items():
        assert mine.evaluation.total[name] == pytest.approx(value, rel=1e-6, nan_ok=True), name
    ratio = run.tested.bracket.tension.ratio
    assert mine.tested.bracket.tension.ratio == pytest.approx(ratio, rel=1e-9)


def test_given_paths_stay_as_they_are(bar, planned):
    given = GivenPaths(planned.runs[1].toolpaths)
    laid = planned.runs[1].length_per_layer
    judged = ccfem.compare(
        bar, {"given": given, "zigzag": create("zigzag")}, fibre_per_layer=0.5 * laid, strand=None
    )
    assert judged.runs[0].length_per_layer == pytest.approx(laid)
    note = f"given paths stay as they are: lays {laid:.0f} of {0.5 * laid:.0f} mm per layer"
    assert judged.runs[0].note == note
    assert judged.ranking[-1].name == "given"


def test_layers_are_found_by_height(planned):
    paths, layers = planned.runs[1].toolpaths, planned.layers
    shuffled = GivenPaths(replace(paths, layer=7 + 3 * paths.layer))
    np.testing.assert_array_equal(shuffled.on(layers).toolpaths.layer, paths.layer)
    np.testing.assert_allclose(shuffled.heights([0.0, 0.0, 1.0]), [1.0, 2.0, 4.0])


def test_paths_off_the_layers_or_not_flat_are_one_line(planned):
    paths = planned.runs[1].toolpaths
    high = GivenPaths(replace(paths, points=paths.points + np.array([0.0, 0.0, 30.0])), "mine.csv")
    with pytest.raises(InputError, match=r"mine.csv: path 0 lies at 31 mm .* on none of the 3"):
        high.on(planned.layers)
    turned = GivenPaths(replace(paths, points=paths.points[:, [2, 0, 1]]), "mine.csv")
    with pytest.raises(InputError, match=r"mine.csv: path \d+ spans .* lies in no flat layer"):
        turned.on(planned.layers)


def test_paths_are_moved_onto_curved_layers(bar, planned):
    # Layers bent to z + x^2 / 200, and paths bent alike but 0.3 mm above them: their feet.
    def bend(points):
        return points + np.array([0.0, 0.0, 1.0]) * (points[:, :1] ** 2 / 200.0)

    paths, flat = planned.runs[1].toolpaths, planned.layers
    layers = [replace(layer, points=bend(layer.points), flat=None) for layer in flat]
    up = np.array([0.0, 0.0, 1.0])
    lifted = replace(paths, points=bend(paths.points + 0.3 * up), layer=0 * paths.layer)
    moved = GivenPaths(lifted).on(layers).toolpaths
    np.testing.assert_array_equal(moved.layer, paths.layer)
    x, _, z = moved.points.T
    level = np.array([1.0, 2.0, 4.0])[np.repeat(paths.layer, np.diff(paths.offsets))]
    np.testing.assert_allclose(z - level, x**2 / 200.0, atol=0.1)  # of cells of 5 mm
    np.testing.assert_allclose(moved.normals[:, 0] / moved.normals[:, 2], -x / 100.0, atol=0.04)
    apart = np.linalg.norm(moved.points - lifted.points, axis=1)
    assert (apart <= 0.3 + 1e-9).all()
    far = replace(paths, points=bend(paths.points + 9.0 * up))
    with pytest.raises(InputError, match=r"path 0 is up to 5\.9\d* mm from the nearest of 3"):
        GivenPaths(far).on(layers)


def test_paths_on_curved_layers_are_judged(tmp_path):
    # Lines along x on two sheets z = z0 + 0.8 sin(pi x / 60), in a file without normals and layers.
    def sheet(x, level):
        return level + 0.8 * np.sin(np.pi * x / 60.0)

    flat = box_mesh((60.0, 24.0, 1.0), (30, 12, 1))
    corners = flat.boundary[(flat.points[flat.boundary][:, :, 2] == 1.0).all(axis=1)]
    x, y, _ = flat.points.T
    rows = ["x,y,z,path,layer"]
    for level in (1, 2):
        lines = [f"v {a} {b} {c}" for a, b, c in zip(x, y, sheet(x, level), strict=True)]
        lines += [f"f {a} {b} {c}" for a, b, c in corners + 1]
        (tmp_path / f"{level}.obj").write_text("\n".join(lines))
        for k, across in enumerate((6.0, 12.0, 18.0)):
            rows += [
                f"{at},{across},{sheet(at, level)},{10 * level + k},0" for at in range(1, 60, 2)
            ]
    (tmp_path / "paths.csv").write_text("\n".join(rows))
    mesh, pull = box_mesh((60.0, 24.0, 4.0), (20, 8, 2)), Force("x_max", (300.0, 0.0, 0.0))
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), {"pull": (pull,)})
    given = {"given": GivenPaths(read_paths(tmp_path / "paths.csv", np.eye(3)), "paths.csv")}
    case = ccfem.Case("strip", "", problem)
    (run,) = ccfem.compare(case, given, layers=Surfaces(str(tmp_path)), strand=None).runs
    assert run.toolpaths.layer.tolist() == [0, 0, 0, 1, 1, 1]
    # The integral of sqrt(1 + (0.8 pi / 60 cos)^2) from 1 to 59.
    s = np.linspace(1.0, 59.0, 20001)
    length = np.trapezoid(np.hypot(1.0, 0.8 * np.pi / 60.0 * np.cos(np.pi * s / 60.0)), s)
    assert run.evaluation.total["fibre_length"] == pytest.approx(6.0 * length, rel=1e-4)
    with pytest.raises(InputError, match=r"lies in no flat layer: .* slicing of their curved"):
        ccfem.compare(case, given, strand=None)
    # Where the part's own layers are curved, those are meant; flat paths say their heights.
    sliced = replace(case, slicing=Surfaces(str(tmp_path)))
    assert Request.of(sliced, given).slicings[""].slicer is None
    paths = given["given"].toolpaths
    low = GivenPaths(replace(paths, points=paths.points * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.5]))
    assert Request.of(sliced, {"low": low}).slicings[""].slicer == Planar(heights=(0.5,))
