"""Matrix laid in air: known areas, held against what a reader of the file finds in it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.print_checks.job import PART
from benchmarks.print_checks.motion import in_air
from benchmarks.print_checks.printer import follow
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.machine import Machine, updated
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import plan_print
from ccfem.printing.support import propped_space
from ccfem.printing.support.overhang import overhang
from ccfem.slicing.slicers.planar import Planar

UP = (0.0, 0.0, 1.0)


def cut_out(size, cells, kept):
    """A box without the cells whose middles (m, 3) are not kept."""
    box = box_mesh(size, cells)
    return TetMesh(box.points, box.cells[kept(box.points[box.corners].mean(axis=1))])


def tee():
    """A stem of 20 x 20 x 25 mm, and a bar of 60 x 20 x 5 mm on it."""
    size, cells = (60.0, 20.0, 30.0), (12, 4, 6)
    return cut_out(size, cells, lambda at: (at[:, 2] > 25.0) | (abs(at[:, 0] - 30.0) < 10.0))


def leaning(degrees):
    """A block of 20 x 20 x 20 mm that leans over to one side."""
    box = box_mesh((20.0, 20.0, 20.0), (4, 4, 4))
    points = np.array(box.points)
    points[:, 0] += np.tan(np.radians(degrees)) * points[:, 2]
    return TetMesh(points, box.cells)


def table(gap):
    """A slab on two feet with a gap between them, mm."""
    size, cells = (40.0, 20.0, 15.0), (40, 4, 6)
    return cut_out(size, cells, lambda at: (at[:, 2] > 10.0) | (abs(at[:, 0] - 20.0) > 0.5 * gap))


def test_the_arms_of_a_tee_are_laid_in_air():
    """Twice 20 x 20 mm, a layer of 0.8 mm high, of 16 cm^3; upside down and on its side nothing."""
    found = overhang(tee(), UP, Machine())
    assert found.region.area == pytest.approx(800.0, rel=0.005)
    assert found.height == pytest.approx(25.0)
    assert found.share == pytest.approx(800.0 * 0.8 / 16000.0, rel=0.005)
    assert found.words.startswith("4.0% of the matrix would be laid in air: 799 mm^2 of the part, ")
    assert overhang(tee(), (0.0, 0.0, -1.0), Machine()) is None
    assert overhang(tee(), (0.0, 1.0, 0.0), Machine()) is None
    turned = overhang(TetMesh(tee().points[:, [2, 0, 1]], tee().cells), (1.0, 0.0, 0.0), Machine())
    assert turned.share == pytest.approx(found.share, rel=1e-6)


@pytest.mark.parametrize("limit", [30.0, 45.0, 60.0])
def test_a_face_may_lean_over_as_far_as_the_machine_allows(limit):
    machine = replace(Machine(), limits=replace(Machine().limits, overhang=limit))
    assert overhang(leaning(limit - 0.5), UP, machine) is None
    found = overhang(leaning(limit + 5.0), UP, machine)
    assert found.region.area == pytest.approx(
        400.0 * np.tan(np.radians(limit + 5.0)), rel=0.07
    )  # but for what lies beside the foot


def test_gaps_that_fibre_may_span_are_bridged():
    """Machine.limits.free_span is 8 mm."""
    assert overhang(table(6.0), UP, Machine()) is None
    assert overhang(table(14.0), UP, Machine()).region.area == pytest.approx(280.0, rel=0.01)


@pytest.mark.parametrize(
    ("mesh", "volume"),
    [
        (tee(), 2 * 20.0 * 20.0 * 25.0),
        (table(20.0), 20.0 * 20.0 * 10.0),
        (leaning(60.0), 0.5 * 20.0 * 20.0 * 20.0 * np.tan(np.radians(60.0))),
        (table(6.0), 0.0),
    ],
)
def test_support_fills_the_space_below_what_is_laid_in_air(mesh, volume):
    """Below both arms, between the feet, in the wedge; not below what is bridged."""
    space = propped_space(mesh, UP, Machine())
    assert (0.0 if space is None else space.volume) == pytest.approx(volume, rel=1e-9)


@pytest.fixture(scope="module")
def files():
    """What a reader finds in the files of the tee: without support, and with it."""
    mesh, machine = tee(), Machine()
    layers = Planar(heights=(2.0, 27.5)).cut(mesh)
    line = np.array([[5.0, 10.0], [55.0, 10.0]])
    fibre = Toolpaths.from_plane([line], layers[1])
    plans = [plan_print(fibre, layers, mesh, machine, support) for support in (False, True)]
    return [(plan, follow(gcode(plan, machine), "chen2021")) for plan in plans]


def test_support_holds_what_would_be_laid_in_air(files):
    machine = Machine()
    (_, free), (_, held) = files
    assert in_air(machine, free) == pytest.approx(0.04, abs=0.004)
    assert in_air(machine, held) < 0.002
    assert free.wrong == held.wrong == []


def test_support_stands_beside_the_stem_and_below_the_arms(files):
    (bare, _), (propped, run) = files
    place = np.array([s.end for s in run.steps if s.lays and s.kind == "Support material"])
    assert place[:, 2].max() < 25.0 + 0.4  # half a layer
    assert place[:, 2].min() == propped.top[0]
    x = place[:, 0] - 0.5 * Machine().gcode.bed[0]
    y = place[:, 1] - 0.5 * Machine().gcode.bed[1]
    assert abs(x).min() > 10.0 + 0.7
    assert abs(x).max() <= 30.0
    assert abs(y).max() <= 10.0
    assert propped.volume(Machine()) == pytest.approx(bare.volume(Machine()), rel=1e-6)


def test_interface_gap_and_clearance_are_as_asked_for():
    mesh, layers = tee(), Planar(heights=(2.0, 27.5)).cut(tee())
    asked = {"support_interface": 4, "support_gap": 0.5, "support_clearance": 3.0}
    machine = updated(Machine(), {"process": asked})
    fibre = Toolpaths.from_plane([np.array([[5.0, 10.0], [55.0, 10.0]])], layers[1])
    plan = plan_print(fibre, layers, mesh, machine, True)
    run = follow(gcode(plan, machine), "chen2021")
    steps = [s for s in run.steps if s.lays and s.kind == "Support material"]
    x = np.array([s.end[0] for s in steps]) - 0.5 * machine.gcode.bed[0]
    assert abs(x).min() == pytest.approx(13.0 + 0.5 * machine.matrix_width, abs=0.01)
    # The first layer of the arms begins where that below it ends; columns end 0.5 mm lower.
    z = np.array([s.end[2] for s in steps]).round(3)
    part = [s.end for s in run.steps if s.lays and s.kind in PART]
    arms = min(end[2] for end in part if abs(end[0] - 0.5 * machine.gcode.bed[0]) > 11.0)
    below = plan.top[plan.top < arms - 1e-3].max()
    assert z.max() == plan.top[plan.top < below - 0.5 + 1e-3].max()
    # Four layers are solid, and the others a quarter of that.
    length = np.array([sum(s.length for s in steps if round(s.end[2], 3) == at) for at in set(z)])
    assert np.count_nonzero(length > 2.0 * np.median(length)) == 4


@pytest.mark.parametrize("deep", [6.0, 20.0])
def test_the_roof_of_a_slot_with_open_ends_is_bridged(deep):
    """A gap of 7 mm below a slab, through the whole depth; at 9 mm it is too wide for 8."""
    for gap, bridged in ((7.0, True), (9.0, False)):
        size, cells = (40.0, deep, 15.0), (40, 2, 6)
        part = cut_out(
            size, cells, lambda at, g=gap: (at[:, 2] > 10.0) | (abs(at[:, 0] - 20.0) > 0.5 * g)
        )
        assert (overhang(part, UP, Machine()) is None) == bridged
