"""Layers rebuilt from the strands of another program, on sheets that are known."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.body.files.layer_files import layer_files, read_layer
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import GivenStress, Problem
from ccfem.fem.elasticity.problem import Force, Support
from ccfem.fem.materials import isotropic
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.machine import Machine
from ccfem.papers.fang_2024.authors import authors_mesh
from ccfem.papers.zhang_2025.contents import authors_strands, strands_on
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.printing.export.path_table import read_paths
from ccfem.slicing.slicers import create

MESH = box_mesh((24.0, 12.0, 10.0), (16, 8, 7))
UP = (0.0, 0.0, 1.0)
BEND = 0.008
"""Height of the sheets over x^2, 1/mm."""


def unloaded(mesh):
    m, n = len(mesh.cells), len(mesh.points)
    return GivenStress(mesh, np.zeros((m, 3, 3)), np.zeros((n, 3, 3)))


def sheet(x, height):
    return height + BEND * (x - 12.0) ** 2


def write(folder, number, height, pitch=1.1):
    """Strands along x on a bent sheet, as the data set has them: pairs of points."""
    x = np.linspace(0.5, 23.5, 40)
    rows = []
    for y in np.arange(0.7, 11.5, pitch):
        ends = np.stack([x[:-1], x[1:]], axis=1).ravel()
        places = zip(ends, sheet(ends, height), strict=True)
        rows += [f"v {a:.6f} {y:.6f} {b:.6f}" for a, b in places]
    rows += [f"l {k + 1} {k + 2}" for k in range(0, len(rows), 2)]
    (folder / f"{number}_C{number}_M_0.obj").write_text("\n".join(rows) + "\n")


def rebuilt(folder, **parameters):
    return create("through_strands", {"folder": str(folder), **parameters})(
        unloaded(MESH), UP, Machine()
    )


def test_layers_are_rebuilt_from_the_strands_on_them(tmp_path):
    for number, height in ((3, 4.0), (20, 5.0), (4, 4.5)):
        write(tmp_path, number, height)
    layers = rebuilt(tmp_path)
    assert len(layers) == 3
    for layer, height in zip(layers, (4.0, 4.5, 5.0), strict=True):
        # A plane over 1.5 mm of a sheet of radius 62 mm lies within hundredths of it.
        away = layer.points[:, 2] - sheet(layer.points[:, 0], height)
        assert np.abs(away).max() < 0.05
        # Length of a parabola of slope s at its ends, 24 mm across, times 12 mm.
        s = 2.0 * BEND * 12.0
        length = 12.0 * (np.hypot(1.0, s) + np.arcsinh(s) / s)
        assert layer.areas.sum() == pytest.approx(12.0 * length, rel=0.01)
        assert layer.normals[:, 2].min() > 0.9  # towards the next layer
        # 0.5 mm along z, where the sheets have slopes of up to 0.19.
        assert 0.49 < layer.thickness < 0.5
    strands = authors_strands(tmp_path)
    moved = strands_on(layers, strands)
    np.testing.assert_array_equal(np.bincount(moved.layer), [10, 10, 10])
    np.testing.assert_allclose(moved.lengths, strands.lengths, rtol=1e-3)


def test_between_lone_strands_layers_lie_across_the_stack(tmp_path):
    """At 5 mm the points near a node are those of one strand, through which any plane goes."""
    for number, height in enumerate((4.0, 4.5, 5.0)):
        write(tmp_path, number, height, pitch=5.0)
    for layer, height in zip(rebuilt(tmp_path), (4.0, 4.5, 5.0), strict=True):
        # Within 4 degrees over 2 mm, at the ends of strands, where all points are on one side.
        away = layer.points[:, 2] - sheet(layer.points[:, 0], height)
        assert np.abs(away).max() < 2.0 * np.tan(np.radians(4.0))
        # Three bands of 4 mm, the outer ones cut by the border at 0.7 and 1.3 mm.
        assert layer.areas.sum() == pytest.approx(24.2 * (2.7 + 4.0 + 3.3), rel=0.1)


def test_a_stack_that_is_printed_downwards_faces_down(tmp_path):
    for number, height in enumerate((5.0, 4.5)):
        write(tmp_path, number, height)
    assert all(layer.normals[:, 2].max() < -0.9 for layer in rebuilt(tmp_path, thickness=0.5))


def test_files_without_a_number_come_last(tmp_path):
    for number, height in ((10, 4.5), (9, 4.0), (11, 5.0)):
        write(tmp_path, number, height)
    (tmp_path / "11_C11_M_0.obj").rename(tmp_path / "top.obj")
    for layer, height in zip(rebuilt(tmp_path), (4.0, 4.5, 5.0), strict=True):
        away = layer.points[:, 2] - sheet(layer.points[:, 0], height)
        assert np.abs(away).max() < 0.05


def test_strands_that_tell_no_layers_are_one_line(tmp_path):
    write(tmp_path, 1, 4.0)
    with pytest.raises(InputError, match=r"two or more, .* got 1: name the folder of all"):
        rebuilt(tmp_path)
    write(tmp_path, 2, 40.0)
    with pytest.raises(InputError, match="no strand of layer 1 lies in the part"):
        rebuilt(tmp_path)


def test_strands_without_layers_are_judged_on_their_own(tmp_path):
    for number, height in enumerate((4.0, 4.5, 5.0)):
        write(tmp_path, number, height)
    paths = read_paths(tmp_path, np.eye(3))
    with pytest.raises(InputError, match=r"in no flat layer: .*through_strands:folder=FOLDER"):
        GivenPaths(paths).heights(np.array(UP))
    pull = Force("x_max", (300.0, 0.0, 0.0))
    problem = Problem(MESH, isotropic(3500.0, 0.35), (Support("x_min"),), {"pull": (pull,)})
    (run,) = ccfem.compare(
        ccfem.Case("bar", "", problem, machine=Machine(minimum_length=20.0)),
        {"theirs": GivenPaths(paths)},
        layers=f"through_strands:folder={tmp_path}",
    ).runs
    assert run.toolpaths.layer.tolist() == paths.layer.tolist()
    # Thirty strands, each of the length of its parabola from 0.5 to 23.5 mm.
    s = 2.0 * BEND * 11.5
    length = 11.5 * (np.hypot(1.0, s) + np.arcsinh(s) / s)
    assert run.evaluation.total["fibre_length"] == pytest.approx(30.0 * length, rel=1e-3)
    # Straight fibre from end to end along the pull, beside plastic in 120 mm^2, is the most.
    most = 1.0 + 30.0 * Strand().rho / 120.0
    assert 1.0 + 0.5 * (most - 1.0) < run.tested.bracket.tension.ratio < most


@pytest.mark.skipif("CCFEM_FANG2024" not in os.environ, reason="data of the authors")
def test_published_layers_are_rebuilt_from_published_strands(tmp_path):
    """Two to four sparse strands a layer: .02 mm from the layer in the median, .11 mm at 95 %."""
    data = Path(os.environ["CCFEM_FANG2024"]) / "TBracket"
    for number in (30, 31, 32):
        shutil.copy(data / "toolpath" / f"{number}.txt", tmp_path)
    layers = create("through_strands", {"folder": str(tmp_path)})(
        unloaded(authors_mesh()), (0.0, 1.0, 0.0), Machine()
    )
    # Files of strands have the number of their layer, counted from 1.
    for layer, file in zip(layers, layer_files(data / "matrixLayer")[29:32], strict=True):
        away = nearest_on_triangles(*read_layer(file), layer.points).distance
        assert np.median(away) < 0.025
        assert np.quantile(away, 0.95) < 0.12
