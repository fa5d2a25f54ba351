"""How values show themselves: pages in notebooks, pictures, views in space."""

import base64
import io
import re

import numpy as np
import pytest
import pyvista
from matplotlib.figure import Figure
from PIL import Image

import ccfem
from ccfem.base.errors import InputError
from ccfem.comparison.plot.scenes import add
from ccfem.slicing.layers.layer import stress_on


@pytest.fixture(scope="module")
def values():
    case = ccfem.read("bar", element_size=12.5)
    stress = ccfem.solve(case.problem)["pull"]
    layers = ccfem.slice(stress, 2, case.build)
    paths = ccfem.plan(ccfem.strategies.Zigzag(spacing=4.0), layers, stress, case.machine)
    return {
        "case": case,
        "problem": case.problem,
        "mesh": case.problem.mesh,
        "stress": stress,
        "layer": layers[0],
        "layer_stress": stress_on(layers[0], stress),
        "paths": paths,
        "check": ccfem.check(case),
        "evaluation": ccfem.evaluate(paths, layers, stress, case.machine),
        "test": ccfem.virtual_test(paths, stress),
    }


@pytest.fixture(scope="module")
def compared(values):
    strategies = {
        "a": ccfem.strategies.Zigzag(spacing=3.0),
        "b": ccfem.strategies.Zigzag(spacing=5.0, angle=0.0),
    }
    return ccfem.compare(values["case"], strategies, layers=2, natural=True, curve=False)


def pictures(page):
    for data in re.findall(r"data:image/png;base64,([^\"]+)", page):
        yield np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))


def test_every_value_has_a_page_with_its_line_and_a_small_picture(values):
    for name, value in values.items():
        page = value._repr_html_()
        assert len(page) < 60_000, name
        if name in ("check", "evaluation"):
            assert "<table" in page
            continue
        assert type(value).__name__ in page
        (picture,) = pictures(page)
        assert picture.min() < 200, f"{name}: an empty picture"
        assert max(picture.shape) < 1200


def test_every_value_is_drawn_in_the_plane(values):
    for name, value in values.items():
        assert isinstance(value.plot(), Figure), name
    assert isinstance(values["paths"].plot(layer=1), Figure)
    with pytest.raises(InputError, match="layer 7 has no fibre; layers with fibre are: 0, 1"):
        values["paths"].plot(layer=7)
    with pytest.raises(InputError, match="no index 'beauty'"):
        values["evaluation"].plot(columns=("beauty",))


def test_what_is_wrong_is_said_with_its_cure(values):
    assert "smaller cells" in values["stress"]._repr_html_()
    assert "no fibre" in ccfem.paths.toolpaths.Toolpaths.empty()._repr_html_()
    with pytest.raises(InputError, match="plan some"):
        ccfem.paths.toolpaths.Toolpaths.empty().plot()


def test_a_view_in_space_without_a_screen_is_a_picture(values, compared, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    view = values["stress"].show()
    assert Image.open(io.BytesIO(view._repr_png_())).size == (900, 650)
    assert view.image.min() < 100
    assert compared.show("b", picture=tmp_path / "paths.png").image.shape == (650, 900, 3)
    assert Image.open(tmp_path / "paths.png").size == (900, 650)
    with pytest.raises(InputError, match=r"written as .png"):
        values["case"].show(picture=tmp_path / "case.gif")
    with pytest.raises(InputError, match="Evaluation is nothing in space"):
        values["evaluation"].show()


def test_a_stress_field_is_drawn_as_it_moves(values):
    """By the scale that is given; else the largest displacement is a twentieth of the diagonal."""
    stress = values["stress"]
    border = np.unique(stress.mesh.boundary)
    still, moved = stress.mesh.points[border], stress.displacement[border]
    largest = np.linalg.norm(moved, axis=1).max()
    diagonal = np.linalg.norm(np.ptp(stress.mesh.points, axis=0))
    for scale in (None, 7.0):
        plotter = pyvista.Plotter(off_screen=True)
        add(stress, plotter, scale=scale)
        factor = 0.05 * diagonal / largest if scale is None else scale
        ends = np.stack(
            [(still + factor * moved).min(axis=0), (still + factor * moved).max(axis=0)]
        )
        np.testing.assert_allclose(np.reshape(plotter.bounds, (3, 2)).T, ends, rtol=1e-6, atol=1e-9)
        plotter.close()


def test_a_comparison_draws_layers_and_fronts(compared):
    assert isinstance(compared.plot(), Figure)
    assert isinstance(compared.plot_layer(0), Figure)
    with pytest.raises(InputError, match="no layer 5; layers are 0 to 1"):
        compared.plot_layer(5)
    for over in ("fibre_length", "print_time_nearest", "first_failure_load"):
        (axes,) = compared.pareto(over).axes
        front, points = axes.lines, axes.collections[0].get_offsets()
        assert len(front) == 1
        table = compared.frame.set_index("strategy").loc[[run.name for run in compared.runs]]
        unit = [60.0 if over == "print_time_nearest" else 1.0, 1.0]  # drawn in minutes
        np.testing.assert_allclose(points * unit, table[[over, "stiffness"]])
    with pytest.raises(InputError, match="fronts are drawn over fibre_length"):
        compared.pareto("taste")
    assert list(pictures(compared._repr_html_()))
    assert list(pictures(compared.runs[0]._repr_html_()))


def test_a_strategy_a_slicer_and_a_case_of_a_notebook_are_compared(values):
    cell = {"__name__": "__main__"}
    exec(
        "from dataclasses import dataclass, replace\n"
        "from typing import ClassVar\n"
        "import ccfem\n"
        "from ccfem.paths.planning import Amount\n"
        "@dataclass(frozen=True)\n"
        "class Rows:\n"
        "    spacing: float = 4.0\n"
        "    amount: ClassVar[Amount] = Amount('spacing', 1.0, 20.0)\n"
        "    def __call__(self, layer, stress, machine):\n"
        "        return ccfem.strategies.Zigzag(self.spacing, angle=0.0)(layer, stress, machine)\n"
        "@dataclass(frozen=True)\n"
        "class Low:\n"
        "    def __call__(self, stress, build, machine):\n"
        "        return ccfem.slicing.slicers.Planar(heights=(1.0,))(stress, build, machine)\n"
        "own = replace(ccfem.read('bar', element_size=12.5), name='own', slicing=Low())\n"
        "found = ccfem.compare(own, ['zigzag', Rows()], natural=True, strand=None)\n"
        "both = ccfem.compare(own, [Rows()], slicings=['planar:z', Low()], strand=None)\n",
        cell,
    )
    assert [run.name for run in cell["found"].succeeded] == ["zigzag", "rows"]
    assert cell["found"].layers[0].flat.height == pytest.approx(1.0)
    assert list(cell["both"].slicings) == ["planar:z", "low"]


def test_faces_are_those_of_the_command(values):
    found = ccfem.faces(values["case"])
    # The outline of the bar: 2 ends, 2 grips with a round each side ..., top and bottom.
    assert found.to_frame()["face"].tolist() == list(range(1, len(found.faces) + 1))
    areas = sum(face.area for face in found.faces)
    mesh = values["mesh"]
    a, b, c = np.moveaxis(mesh.points[mesh.boundary], 1, 0)
    assert areas == pytest.approx(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    assert "<table" in found._repr_html_()


def test_the_help_of_every_command_names_its_call_in_python():
    from ccfem.cli.commands import CALLS, app

    names = [each.name or each.callback.__name__ for each in app.registered_commands]
    assert sorted(CALLS) == sorted(names)
    for command in app.registered_commands:
        call = command.epilog.removeprefix("In Python: ")
        value = ccfem
        for part in call.partition("(")[0].split(".")[1:]:
            value = getattr(value, part)
        assert callable(value), call
