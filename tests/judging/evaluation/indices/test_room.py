"""Room of the strands of a layer: areas, volumes and spans that are known from the drawing."""

import numpy as np
import pytest

from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.judging.evaluation.indices.room import room_indices, sample_room
from ccfem.judging.evaluation.layer_paths import pool
from ccfem.judging.evaluation.strand_rules import why_not
from ccfem.machine import Limits, Machine

MACHINE = Machine(fibre_width=1.0, fibre_height=0.1, filament_area=0.1)


def indices(paths, below=None, machine=MACHINE):
    return room_indices(sample_room(paths, machine, below))


def test_layers_that_repeat_others_add_no_values_to_the_pool(pulled, monkeypatch):
    """The index of many equal layers is that of one, whether or not equal values are merged."""
    line = [[5.0, 10.0], [55.0, 10.0]]
    samples = sample_room(pulled.plane(line, [[5.0, 10.4], [30.0, 10.4]]), MACHINE)
    monkeypatch.setattr("ccfem.judging.evaluation.layer_paths._MANY", len(samples.stack))
    pooled = pool([samples] * 50)
    assert len(pooled.stack) <= 3 * len(samples.stack)
    assert pooled.stack_length.sum() == pytest.approx(50 * samples.stack_length.sum(), rel=1e-12)
    one, many = room_indices(samples), room_indices(pooled)
    assert many["stack_99"] == one["stack_99"] == 2.0
    assert many["fibre_fraction_99"] == one["fibre_fraction_99"]


def test_strands_a_width_apart_lie_on_nothing(pulled):
    values = indices(pulled.plane(*[[[5, y], [55, y]] for y in 5.0 + np.arange(6)]))
    assert values["on_fibre"] == pytest.approx(0.0, abs=1e-9)
    assert values["overlap_area"] == pytest.approx(0.0, abs=1e-6)
    assert (values["across_fibre"], values["outside_width"]) == (0.0, 0.0)
    assert (values["stack_99"], values["free_span"], values["free_length"]) == (1.0, 0.0, 0.0)
    # 6 strands of 50 mm in 60 x 40 x 2 mm; a strand in a cell of 1 x 2 mm
    assert values["fibre_fraction"] == pytest.approx(6 * 50.0 * 0.1 / 4800.0)
    assert values["fibre_fraction_99"] == pytest.approx(0.1 / 2.0)


@pytest.mark.parametrize("copies", [2, 5])
def test_copies_lie_on_each_other(pulled, copies):
    values = indices(pulled.plane(*[[[5, 20], [55, 20]]] * copies))
    assert values["on_fibre"] == pytest.approx(1.0 - 1.0 / copies)
    assert values["overlap_area"] == pytest.approx(50.0 * (copies - 1))
    assert values["stack_99"] == copies
    assert values["fibre_fraction_99"] == pytest.approx(copies * 0.05)


def test_crossing_strands_overlap_by_the_square_of_their_width(pulled):
    values = indices(pulled.plane([[5, 20], [55, 20]], [[30, 5], [30, 35]]))
    assert values["on_fibre"] == pytest.approx(0.0, abs=1e-9)
    assert values["overlap_area"] == pytest.approx(1.0, rel=0.05)
    # of each strand, half of one width is shared
    assert values["across_fibre"] == pytest.approx(1.0 / 80.0, rel=0.05)


@pytest.mark.parametrize(("y", "outside"), [(0.5, 0.0), (0.0, 0.5), (0.2, 0.3)])
def test_what_stands_out_of_the_part_is_measured_by_width(pulled, y, outside):
    values = indices(pulled.plane([[5, y], [55, y]]))
    assert values["outside_width"] == pytest.approx(outside)
    assert values["fibre_fraction"] == pytest.approx((1.0 - outside) * 50.0 * 0.1 / 4800.0)


def test_fibre_outside_the_section_hangs_free(pulled):
    values = indices(pulled.plane([[40, 20], [72, 20]], [[10, 10], [20, 10]]))
    assert values["free_span"] == pytest.approx(12.0, abs=0.5)
    assert values["free_length"] == pytest.approx(12.0, abs=0.5)


def test_links_are_cut_off_beside_the_part_but_not_over_a_hole(framed):
    # the window is 20 x 10 mm round (30, 20)
    over = framed.plane([[5, 20], [20, 20], [40, 20], [55, 20]], links=[[1]])
    assert indices(over)["free_span"] == pytest.approx(20.0, abs=0.5)
    beside = framed.plane([[5, 5], [60, 5], [70, 5], [70, 8], [60, 8]], links=[[1, 2, 3]])
    assert indices(beside)["free_span"] == 0.0
    assert indices(framed.plane([[5, 20], [55, 20]]))["free_span"] == pytest.approx(20.0, abs=0.5)


def test_fibre_needs_something_below(make_part, uniform):
    """A part that is 60 mm wide at its foot and 80 mm at its top."""
    mesh = box_mesh((60.0, 40.0, 2.0), (12, 8, 1))
    points = np.array(mesh.points)
    points[:, 0] = 30.0 + (points[:, 0] - 30.0) * (1.0 + points[:, 2] / 6.0)
    part = make_part(uniform(1.0), mesh=TetMesh(points, mesh.cells), count=2)
    low, high = part.layers
    # At 0.5 mm it reaches 32.5 mm from its middle, at 1.5 mm 37.5 mm.
    paths = part.plane([[-7, 20], [67, 20]], layer=1)
    assert indices(paths)["free_span"] == 0.0
    low, high = low.plane.polygon, high.plane.polygon
    assert indices(paths, low)["free_span"] == pytest.approx(37.0 - 32.5 - 0.5, abs=0.6)
    assert indices(paths, high)["free_span"] == 0.0


def test_no_fibre_has_no_room(pulled):
    values = indices(pulled.plane())
    assert np.isnan([values[k] for k in ("on_fibre", "outside_width", "stack_99")]).all()
    assert (values["overlap_area"], values["free_span"], values["fibre_fraction"]) == (0, 0, 0)


GOOD = {
    "long_enough_length": 1.0,
    "curvature_ok": 0.97,
    "on_fibre": 0.01,
    "across_fibre": 0.01,
    "outside_width": 0.0,
    "outside_height": 0.0,
    "free_span": 0.0,
    "link_inside": 0.0,
    "link_over_void": 0.0,
    "link_outside": 10.0,
    "fibre_length": 1000.0,
    "fibre_fraction_99": 0.4,
    "out_of_order": 0.0,
    "thickness_95": 4.5,
    "tilt_mean": 0.0,
}


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ({"long_enough_length": 0.4}, "60% of the fibre lies in paths shorter than 42 mm"),
        ({"curvature_ok": 0.5}, "50% of the fibre turns tighter than 3.85 mm"),
        ({"on_fibre": 0.62}, "62% of the fibre lies on other fibre of its direction"),
        ({"across_fibre": 0.4}, "40% of the fibre lies across other fibre"),
        ({"outside_width": 0.5}, "50% of the strands, by their width, lies outside the part"),
        ({"outside_height": 0.5}, "50% of the fibre stands out of the part's top or bottom"),
        ({"free_span": 12.34}, "fibre hangs free over 12.3 mm"),
        ({"link_inside": 900.0}, "91% of the fibre is marked as links"),
        ({"fibre_fraction_99": 1.3}, "a fibre volume fraction of 1.30"),
        (
            {"tilt_mean": 20.0},
            "curved layers up to 4.5 mm thick, more than a line of matrix is wide",
        ),
        ({"out_of_order": 3.0}, "3 paths come after one of a higher layer"),
    ],
)
def test_each_thing_that_breaks_a_print_is_named(broken, said):
    assert why_not(GOOD, Machine()) == ()
    (reason,) = why_not(GOOD | broken, Machine())
    assert reason.startswith(said)


def test_the_worst_comes_first_and_limits_are_the_machine_s():
    broken = GOOD | {"on_fibre": 0.9, "curvature_ok": 0.7}
    first, second = why_not(broken, Machine())
    assert "other fibre" in first
    assert "tighter" in second
    assert why_not(broken, Machine(limits=Limits(on_fibre=1.0, tight=1.0))) == ()
    assert why_not(GOOD | dict.fromkeys(("on_fibre", "curvature_ok"), np.nan), Machine()) == ()
