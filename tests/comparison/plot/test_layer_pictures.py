import io

import numpy as np
import pytest
from PIL import Image

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.comparison.plot.canvas import extents_of, inches_per_mm, new_figure, png, save
from ccfem.comparison.plot.colours import INK, LINK, SECTION, palette, scale
from ccfem.comparison.plot.fields import tension_picture
from ccfem.comparison.plot.paths import (
    Coloured,
    compare_layer,
    force_on_paths,
    layer_picture,
    mark_failure,
    tension_limit,
)
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import LayerStress
from ccfem.slicing.slicers.planar import Planar

LAYER = Planar(count=1).cut(box_mesh((60.0, 30.0, 4.0), (6, 3, 1)))[0]


def uniform(s11, s22=0.0, s12=0.0):
    """The same stress everywhere on the layer."""
    tensor = np.zeros((3, 3))
    tensor[0, 0], tensor[1, 1], tensor[0, 1], tensor[1, 0] = s11, s22, s12, s12
    nodal = np.broadcast_to(tensor, (len(LAYER.points), 3, 3))
    cell = np.broadcast_to(tensor, (len(LAYER.triangles), 3, 3))
    return LayerStress(LAYER, cell, nodal)


def straight():
    return Toolpaths.from_plane([np.array([[20.0, 15.0], [40.0, 15.0]])], LAYER)


def pixels(figure):
    return np.asarray(Image.open(io.BytesIO(png(figure))).convert("RGB")).astype(int)


def pixel(figure, x, y):
    """Colour of the picture at a point of the layer."""
    image = pixels(figure)
    column, row = figure.axes[0].transData.transform([x, y])
    return image[len(image) - 1 - int(row), int(column)]


def rgb(colour):
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])


def test_strategies_keep_their_colours_and_others_get_their_own():
    alone, together = palette(["zigzag"]), palette(["mine", "isocurve", "zigzag", "yours"])
    assert alone["zigzag"] == together["zigzag"]
    assert len(set(together.values())) == 4


def test_scales_grow_darker():
    for name in ("stress", "field", "size"):
        brightness = scale(name)(np.linspace(0.0, 1.0, 50))[:, :3] @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(brightness) < 0.0).all()


@pytest.mark.parametrize("columns", [1, 3])
@pytest.mark.parametrize("extents", [(0, 0, 60, 30), (-5, 0, 5, 200), (0, 0, 300, 8)])
def test_scale_of_a_picture(extents, columns):
    """Against the transform that matplotlib draws with."""
    figure, axes = new_figure(extents, columns)
    figure.canvas.draw()
    for one in axes:
        for step in ([1.0, 0.0], [0.0, 1.0]):
            ends = one.transData.transform([[0.0, 0.0], step])
            dots = np.linalg.norm(ends[1] - ends[0])
            assert inches_per_mm(one) == pytest.approx(dots / figure.dpi, rel=1e-6)


def test_extents():
    assert extents_of(LAYER.plane.points) == pytest.approx((0.0, 0.0, 60.0, 30.0))


def test_section_and_path_are_where_they_should_be():
    figure = layer_picture(LAYER, None, straight(), width=2.0, heading="zigzag", caption="20 mm")
    np.testing.assert_allclose(pixel(figure, 25.0, 15.0), rgb(INK), atol=16)
    np.testing.assert_allclose(pixel(figure, 25.0, 20.0), rgb(SECTION), atol=16)
    np.testing.assert_allclose(pixel(figure, 61.0, 15.0), 255, atol=0)


def test_tension_colours_the_section():
    low = pixel(layer_picture(LAYER, uniform(1.0), straight(), 2.0, limit=10.0), 10.0, 5.0)
    high = pixel(layer_picture(LAYER, uniform(9.0), straight(), 2.0, limit=10.0), 10.0, 5.0)
    none = pixel(layer_picture(LAYER, uniform(-9.0), straight(), 2.0, limit=10.0), 10.0, 5.0)
    assert high[2] < low[2] < none[2]
    np.testing.assert_allclose(none, rgb(SECTION), atol=16)


def test_only_the_paths_of_the_layer_are_drawn():
    paths = straight()
    other = Toolpaths(paths.points, paths.normals, paths.offsets, [1], paths.kind, paths.closed)
    figure = layer_picture(LAYER, None, other, width=2.0)
    np.testing.assert_allclose(pixel(figure, 25.0, 15.0), rgb(SECTION), atol=16)


def test_several_strategies_side_by_side():
    paths = {"isocurve": straight(), "zigzag": Toolpaths.empty()}
    figure = compare_layer(LAYER, uniform(5.0), paths, 1.0, {"isocurve": "20 mm"})
    one = layer_picture(LAYER, uniform(5.0), straight(), 1.0)
    assert figure.get_figwidth() == 2.0 * one.get_figwidth()
    texts = [text.get_text() for text in figure.texts]
    assert {"isocurve", "zigzag", "20 mm"} <= set(texts)


def test_pieces_are_coloured_by_their_values():
    ends = np.array([[[10.0, 10.0], [20.0, 10.0]], [[40.0, 10.0], [50.0, 10.0]]])
    own = Coloured(ends, np.array([1.0, 9.0]), "N", (0.0, 10.0))
    figure = layer_picture(LAYER, uniform(5.0), Toolpaths.empty(), 2.0, coloured=own)
    for x, value in ((15.0, 0.1), (45.0, 0.9)):
        expected = 255.0 * np.array(scale("size")(value)[:3])
        np.testing.assert_allclose(pixel(figure, x, 10.0), expected, atol=16)


def test_failure_is_marked():
    figure = layer_picture(LAYER, None, Toolpaths.empty(), 1.0)
    before = pixels(figure)
    mark_failure(figure.axes[0], np.array([20.0, 10.0]), "fibre 6.2 kN")
    changed = np.argwhere((np.abs(pixels(figure) - before) > 60).any(axis=2))
    column, row = figure.axes[0].transData.transform([20.0, 10.0])
    np.testing.assert_allclose(changed[:, 0].max(), len(before) - 1 - row + 11, atol=12)
    np.testing.assert_allclose(changed[:, 1].min(), column - 11, atol=12)


def test_tension_limit_of_a_uniform_field():
    assert tension_limit(uniform(3.0, 1.0)) == pytest.approx(3.0)
    # Pure shear tau has the principal stresses +-tau.
    assert tension_limit(uniform(0.0, 0.0, 2.0)) == pytest.approx(2.0)
    assert 0.0 < tension_limit(uniform(-1.0, -2.0)) < 1e-6


def test_force_is_that_of_the_pieces_on_the_layer():
    middle = np.array([[10.0, 10.0, LAYER.plane.height], [20.0, 10.0, LAYER.plane.height + 1.0]])
    tangent = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    found = force_on_paths(middle, tangent, np.array([2.0, 2.0]), np.array([7.0, 9.0]), LAYER)
    np.testing.assert_allclose(found.segments, [[[9.0, 10.0], [11.0, 10.0]]])
    np.testing.assert_array_equal(found.values, [7.0])
    assert found.limits == (0.0, 7.0)


def test_no_fibre_gives_a_picture_too():
    none = np.zeros((0, 3))
    own = force_on_paths(none, none, np.zeros(0), np.zeros(0), LAYER)
    assert len(own.values) == 0
    assert len(png(layer_picture(LAYER, None, Toolpaths.empty(), 1.0, coloured=own))) > 0


def test_strokes_run_along_the_tension():
    figure = tension_picture(uniform(0.0, 5.0), "Tension")
    strokes = figure.axes[0].collections[-1].get_segments()
    assert len(strokes) > 20
    for a, b in strokes:
        assert a[0] == pytest.approx(b[0])
        assert abs(a[1] - b[1]) > 0.1
    none = tension_picture(uniform(-5.0, -5.0)).axes[0].collections[-1]
    assert len(none.get_segments()) == 0


def test_no_figure_is_left_in_pyplot():
    import matplotlib.pyplot as plt

    before = plt.get_fignums()
    png(layer_picture(LAYER, uniform(5.0), straight(), 1.0, "a", "b"))
    assert plt.get_fignums() == before


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_pictures_are_written(tmp_path, suffix):
    save(layer_picture(LAYER, None, straight(), 1.0), tmp_path / f"a{suffix}")
    start = (tmp_path / f"a{suffix}").read_bytes()[:8]
    assert start.startswith({".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}[suffix])
    assert [path.name for path in tmp_path.iterdir()] == [f"a{suffix}"]


def test_pictures_that_cannot_be_written(tmp_path):
    figure = layer_picture(LAYER, None, straight(), 1.0)
    with pytest.raises(InputError, match="no folder"):
        save(figure, tmp_path / "missing" / "a.png")
    with pytest.raises(InputError, match="change its suffix"):
        save(figure, tmp_path / "a.bmp2")
    assert list(tmp_path.iterdir()) == []


def test_pictures_show_links_outside_the_section():
    line = np.array([[10.0, 15.0], [50.0, 15.0], [80.0, 15.0]])
    paths = Toolpaths.from_plane([line], LAYER, link=[np.array([False, True, False])])
    inside = layer_picture(LAYER, None, straight(), 1.0).axes[0].get_xlim()
    for figure in (
        layer_picture(LAYER, None, paths, 1.0),
        compare_layer(LAYER, None, {"isocurve": straight(), "zigzag": paths}, 1.0),
    ):
        left, right = figure.axes[0].get_xlim()
        assert left < 0.0
        assert right > 80.0 > inside[1]


def test_links_have_a_colour_of_their_own():
    line = np.array([[10.0, 8.0], [50.0, 8.0], [50.0, 22.0], [10.0, 22.0]])
    paths = Toolpaths.from_plane([line], LAYER, link=[np.array([False, True, False, False])])
    figure = layer_picture(LAYER, None, paths, 4.0)
    for x, y, colour in [(30.0, 8.0, INK), (50.0, 15.0, LINK), (30.0, 22.0, INK)]:
        np.testing.assert_allclose(pixel(figure, x, y), rgb(colour), atol=2)
