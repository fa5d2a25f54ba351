"""Parts that are turned on the bed, and copies of them, read back from the file."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.job import Lines
from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases import read
from ccfem.machine import Machine, machine_names, machine_table, updated
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.bed_layout import BedLayout, bed_of, bed_table, turned
from ccfem.printing.before_solving import refusal
from ccfem.printing.beside import beside
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import plan_print
from ccfem.printing.together import arranged
from ccfem.slicing.layers.layer import plane_frame
from ccfem.slicing.slicers.planar import Planar


def rotation(turns):
    """Rotation of a body by turns about fixed axes, one after the other."""
    whole = np.eye(3)
    for text in turns:
        axis, angle = text.split("=")
        whole = Rotation.from_euler(axis, float(angle), degrees=True).as_matrix() @ whole
    return whole


@pytest.mark.parametrize(
    "turns", [["z=37"], ["x=90"], ["y=-90", "z=10"], ["x=180"], ["x=33", "y=12", "z=-170"]]
)
@pytest.mark.parametrize("build", [(0.0, 0.0, 1.0), (0.3, -1.0, 0.2)])
def test_turns_lead_where_a_body_in_the_hand_is_turned(turns, build):
    up, spin = turned(build, turns)
    by_hand = rotation(turns) @ plane_frame(build)
    np.testing.assert_allclose(BedLayout(spin).frame(plane_frame(up)), by_hand, atol=1e-9)
    if len(turns) == 1 and "37" not in turns[0] and build[2] == 1.0:
        assert sorted(np.abs(up)) == [0.0, 0.0, 1.0]  # exactly an axis


def test_the_table_of_a_turned_part_reads_as_the_same():
    up, layout = bed_of((0.0, 0.0, 1.0), {"turn": ["x=90", "z=37"], "copies": "2x3"})
    again = bed_of(up, bed_table(layout))
    assert again == (up, layout)
    assert layout.count == 6


@pytest.mark.parametrize(
    ("turns", "name"),
    [
        (["z=37"], "marlin_two_tools"),
        (["x=90"], "aura_like"),
        (["y=90", "z=-20"], "marlin_two_tools"),
    ],
)
def test_a_turned_part_prints_as_one_turned_by_hand(turns, name):
    machine = updated(Machine(), machine_table(name), {"matrix_height": 0.4})
    mesh = box_mesh((50.0, 4.0, 46.0), (4, 1, 4))
    up, spin = turned((0.0, 0.0, 1.0), turns)
    turn = rotation(turns)
    by_hand = TetMesh(mesh.points @ turn.T, mesh.cells)
    plans = []
    for body, build, angle in ((mesh, up, spin), (by_hand, (0.0, 0.0, 1.0), 0.0)):
        level = (body.points @ np.array(build)).min() + 1.3
        (layer,) = Planar(heights=(level,)).cut(body, build)
        # A line across the middle of the layer, along an axis of the body.
        corners = layer.points
        axis = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < 0.5 else np.array([1.0, 0.0, 0.0])
        along = turn @ axis if body is by_hand else axis
        reach = np.ptp(corners @ along)
        ends = corners.mean(axis=0) + np.array([[-0.4], [0.4]]) * reach * along
        lines = Toolpaths.from_plane([layer.plane.project(ends)], layer)
        plans.append(plan_print(lines, [layer], body, machine, spin=angle))
    ours, theirs = plans
    np.testing.assert_allclose(ours.top, theirs.top, atol=1e-3)
    assert len(ours.paths) == len(theirs.paths)
    np.testing.assert_allclose(ours.paths.lengths.sum(), theirs.paths.lengths.sum(), rtol=1e-4)
    for number in range(len(ours.top)):
        mine, other = ours.paths.on_layer(number).points, theirs.paths.on_layer(number).points
        assert len(mine) == len(other)
        far = np.linalg.norm(mine[:, None] - other[None], axis=2)
        assert max(far.min(axis=0).max(), far.min(axis=1).max()) < 3e-3


GRID = (2, 3)


@pytest.fixture(scope="module", params=machine_names())
def several(request, small_part):
    values = {"gcode": {"bed": [400.0, 300.0, 200.0]}, "process": {"brim_loops": 0}}
    return small_part(request.param, values, copies=GRID)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_copies_print_with_every_machine(several, check):
    assert check(several, several.done) == []


def test_copies_are_laid_together_and_what_is_beside_them_once(several, small_part):
    alone = small_part(several.name, {"gcode": {"bed": [400.0, 300.0, 200.0]}}).done
    run, count = several.done, GRID[0] * GRID[1]
    assert len(run.changes) == len(alone.changes)
    assert len(run.strands()) == count * (len(alone.strands()) - 1) + 1
    lines, single = Lines.of(run), Lines.of(alone)

    def laid(of, tool):
        here = of.lays & of.in_part & (of.tool == tool) & ~of.beside_part
        return of.length[here].sum(), (of.fed + of.beside)[here].sum()

    for tool in (0, 1):
        np.testing.assert_allclose(laid(lines, tool), count * np.array(laid(single, tool)))
    bar = [step for step in run.steps if step.strand.startswith("beside") and step.lays]
    assert sum(step.length for step in bar) == pytest.approx(several.machine.tail + 20.0)
    # The skirt goes round the lowest and the highest corner of all copies, in as many loops.
    skirt = lines.lays & (lines.kind == "Skirt/Brim")
    low, high = several.corners.min(axis=0), several.corners.max(axis=0) + several.size[:2]
    assert (lines.end[skirt, :2].min(axis=0) < low).all()
    assert (lines.end[skirt, :2].max(axis=0) > high).all()
    inside = (lines.end[skirt, :2] > low) & (lines.end[skirt, :2] < high)
    assert not inside.all(axis=1).any()
    assert several.plan.copies == count


def box_plan(machine, size=(60.0, 40.0, 2.0)):
    mesh = box_mesh(size, (3, 3, 1))
    layers = Planar(heights=(1.0,)).cut(mesh)
    lines = [np.array([[2.0, 5.0], [size[0] - 2.0, 5.0]])]
    return mesh, layers, plan_print(Toolpaths.from_plane(lines, layers[0]), layers, mesh, machine)


@pytest.mark.parametrize(("name", "brim"), [("marlin_two_tools", 5), ("aura_like", 0)])
def test_a_refusal_says_how_many_fit_and_so_many_do(name, brim):
    machine = updated(Machine(), machine_table(name), {"process": {"brim_loops": brim}})
    mesh, layers, plan = box_plan(machine)
    with pytest.raises(InputError, match="do not fit on the bed") as refused:
        arranged([plan], [BedLayout(copies=(100,))], machine)
    assert len(refused.value.mistakes) == 1
    most = int(str(refused.value).split(";")[1].split()[0])
    bed = np.prod(np.array(machine.gcode.bed[:2]) // (np.array([60.0, 40.0]) + 4.0))
    assert 0.3 * bed < most <= bed
    for count, good in ((most, True), (most + 1, False)):
        layout = BedLayout(copies=(count,))
        assert (refusal(mesh, (0.0, 0.0, 1.0), machine, layers, layout) == "") == good
        if good:
            part_moves(arranged([plan], [layout], machine), machine)  # it checks both nozzles
        else:
            with pytest.raises(InputError, match=f"{most} fit"):
                arranged([plan], [layout], machine)


def test_copies_keep_their_distance_and_their_brims_apart():
    machine = updated(Machine(), {"process": {"brim_loops": 6}})
    *_, plan = box_plan(machine)
    copied = arranged([plan], [BedLayout(copies=(2, 1))], machine)
    first = copied.paths.on_layer(0)
    x = np.unique(np.concatenate([line[:, 0] for line in first]).round(3))
    assert np.diff(x).max() == pytest.approx(4.0 + 2 * 6 * 0.8 + 0.8, abs=2e-3)
    rings = beside(copied, machine).skirt
    brims = [ring for ring in rings if np.ptp(ring[:, 0]) < 100.0]
    assert len(brims) == 2 * 6
    assert len(rings) == 2 * 6 + machine.process.skirt_loops


def test_a_part_stands_where_it_is_wanted():
    machine = Machine()
    mesh, layers, plan = box_plan(machine)
    placed = arranged([plan], [BedLayout(centre=(200.0, 90.5))], machine)
    ends = placed.paths.points[:, :2]
    np.testing.assert_allclose(0.5 * (ends.min(axis=0) + ends.max(axis=0)), [200.0, 90.5])
    group = arranged([plan], [BedLayout(centre=(180.0, 150.0), copies=(3,))], machine).paths.points
    middle = 0.5 * (group.min(axis=0) + group.max(axis=0))
    np.testing.assert_allclose(middle[:2], [180.0, 150.0], atol=1e-3)
    for layout in (BedLayout(centre=(10.0, 150.0)), BedLayout(centre=(60.0, 150.0), copies=(3, 1))):
        assert "mm" in refusal(mesh, (0.0, 0.0, 1.0), machine, layers, layout)
        with pytest.raises(InputError):
            arranged([plan], [layout], machine)
    # The range that is named is the range that is taken, to 0.1 mm.
    said = refusal(mesh, (0.0, 0.0, 1.0), machine, layers, BedLayout(centre=(1.0, 1.0)))
    least, most, *_ = (float(x) for x in re.findall(r"[\d.]+(?= to| and Y)", said))
    for x, good in ((least + 0.1, True), (least - 0.1, False), (most - 0.1, True)):
        layout = BedLayout(centre=(x, 150.0))
        assert (refusal(mesh, (0.0, 0.0, 1.0), machine, layers, layout) == "") == good
    # Copies that fit beside the block only out of the middle stand aside.
    wide, *_, long = box_plan(machine, (85.0, 40.0, 2.0))
    part_moves(arranged([long], [BedLayout(copies=(3, 1))], machine), machine)
    assert "do not fit" in refusal(wide, (0.0, 0.0, 1.0), machine, layers, BedLayout(copies=(4, 1)))


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"turn": "37"}, "AXIS=DEGREES"),
        ({"turn": ["w=3"]}, "AXIS=DEGREES"),
        ({"turn": ["x=nan"]}, "AXIS=DEGREES"),
        ({"turn": [3]}, "bed.turn must be"),
        ({"centre": [1.0]}, "bed.centre must be"),
        ({"centre": [1.0, float("nan")]}, "number"),
        ({"copies": 0}, "at least 1"),
        ({"copies": "2x"}, "2x3"),
        ({"copies": "200x200"}, "at most 1000"),
        ({"copies": True}, "bed.copies must be"),
        ({"spin": 3}, "has no key"),
    ],
)
def test_what_is_no_place_on_a_bed_is_refused(table, said):
    with pytest.raises(InputError, match=said):
        bed_of((0.0, 0.0, 1.0), table)


def test_turning_changes_the_layers_and_leaves_loads_alone():
    case = read("loop", element_size=8.0)
    turned_case, by_hand = case.on_bed({"turn": ["x=90"]}), replace(case, build=(0.0, 1.0, 0.0))
    assert turned_case.problem is case.problem
    ours, theirs = turned_case.known_layers(), by_hand.known_layers()
    for mine, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(mine.points, other.points)
