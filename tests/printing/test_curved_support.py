"""Support, skirt and block in the file of a part of curved layers, by a reader of its own."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.engine import Solved, compare
from ccfem.fem.elasticity import Problem
from ccfem.fem.materials import isotropic
from ccfem.machine import Kinematics, Machine, Process
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import plan_print
from ccfem.printing.support import support_layers, support_paths
from ccfem.slicing.layers.level_surfaces import level_surfaces
from ccfem.slicing.layers.slicer import standing
from ccfem.slicing.slicers import Planar

CENTRE = (150.0, 150.0, -30.0)
STEP = 1.0


@pytest.fixture(scope="module")
def part():
    """An arch of 30 x 10 x 6 mm: its layers fall by 1.4 mm to both ends."""
    mesh = box_mesh((30.0, 10.0, 6.0), (15, 5, 3))
    x, _, z = mesh.points.T
    field = z - 0.006 * (x - 15.0) ** 2
    levels = np.arange(field.min() + 0.5 * STEP, field.max(), STEP)
    layers = level_surfaces(mesh, field, levels, STEP, 1.0, 2.0).layers
    support = support_layers(mesh, layers, field=field, step=STEP)
    return mesh, layers, support


def moves(text):
    """Rows of tip (3), axis (3), matrix fed, tool, and what it is; heats before each tool's first.

    A state machine of this test alone: absolute axes, relative E, M109 waits for a tool.
    """
    at, tool, what, waited, rows, kinds = dict.fromkeys("XYZABC", 0.0), 0, "", {0: 0.0}, [], []
    for line in text.splitlines():
        if line.startswith(";TYPE:"):
            what = line[6:]
        code = line.split(";")[0].split()
        if not code:
            continue
        given = {word[0]: float(word[1:]) for word in code[1:] if len(word) > 1}
        if code[0] in ("T0", "T1"):
            tool = int(code[0][1])
        elif code[0] == "M109":
            waited[int(given.get("T", tool))] = given["S"]
        elif code[0] in ("G0", "G1"):
            moved = any(key in at for key in given)
            at.update({key: value for key, value in given.items() if key in at})
            fed = given.get("E", 0.0) if code[0] == "G1" else 0.0
            if fed > 0.0:
                assert waited.get(tool, 0.0) > 170.0
            rows.append([*at.values(), fed if moved else 0.0, tool, moved])
            kinds.append(what if code[0] == "G1" and moved and fed > 0.0 else "")
    rows = np.array(rows)
    linear, (a, _, c) = rows[:, :3], rows[:, 3:6].T
    # A and C are zero where the head stays upright.
    table = Rotation.from_euler("zx", np.column_stack([c, a]), degrees=True).inv()
    place = table.apply(linear - CENTRE) + CENTRE
    axis = table.apply([0.0, 0.0, 1.0])
    return np.column_stack([place, axis, rows[:, 6:8]]), np.array(kinds)


def between(place, chosen):
    """Points every half millimetre along the chosen moves, and the number of the move of each."""
    points, number = [np.zeros((0, 3))], [np.zeros(0, dtype=int)]
    for k in np.flatnonzero(chosen).tolist():
        step = place[k] - place[k - 1]
        share = np.linspace(0.0, 1.0, int(np.linalg.norm(step) / 0.5) + 2)[1:]
        points.append(place[k - 1] + share[:, None] * step)
        number.append(np.full(len(share), k))
    return np.concatenate(points), np.concatenate(number)


@pytest.mark.parametrize("kind", ["table_table", "three_axes"])
def test_support_is_printed_below_the_part_and_before_it(part, kind):
    mesh, layers, support = part
    machine = Machine(kinematics=Kinematics(kind, CENTRE), process=Process(skirt_loops=1))
    text = gcode(plan_print(Toolpaths.empty(), layers, mesh, machine, support=support), machine)
    rows, kinds = moves(text)
    place, fed = rows[:, :3], rows[:, 6]
    props = kinds == "Support material"
    own = np.isin(kinds, ["External perimeter", "Solid infill"])
    # Amount: rings three widths apart fill a third of the space below, but the two layers below
    # the part all of theirs; the part is full.
    area = 0.25 * np.pi * 1.75**2
    full = 2.0 * STEP * 30.0 * 10.0
    laid = (support.columns.volume + 2.0 * full) / 3.0
    assert fed[props].sum() * area == pytest.approx(laid, rel=0.1)
    assert fed[own].sum() * area == pytest.approx(30.0 * 10.0 * 6.0, rel=0.03)
    # Nothing is laid below the bed, nothing of the part below its support.
    assert place[props][:, 2].min() > 0.3 * STEP
    lift = -support.columns.mesh.points[:, 2].min()
    assert place[own][:, 2].min() > lift
    # No line of support comes after a line of the part above it.
    below, early = between(place, props)
    above, late = between(place, own)
    for point, when, near in zip(
        below, early, cKDTree(above[:, :2]).query_ball_point(below[:, :2], 0.4), strict=True
    ):
        over = np.array(near, dtype=int)
        over = over[above[over, 2] > point[2] + 0.5 * STEP]
        assert (late[over] > when).all()
    # Both lie inside the part's outline; block and skirt lie outside.
    beside = np.isin(kinds, ["Wipe tower", "Skirt/Brim"])
    for chosen, inside in ((props, True), (own, True), (beside, False)):
        points, _ = between(place, chosen)
        off = np.abs(points[:, :2] - 150.0) - [15.0, 5.0]
        assert ((off.max(axis=1) < 0.3) == inside).all()
    assert {"Wipe tower", "Skirt/Brim"} <= set(kinds)
    # The block comes before anything else on the bed, and is never laid in thick lines.
    assert kinds[np.flatnonzero(fed > 0.0)[0]] == "Wipe tower"
    heights = np.unique(place[kinds == "Wipe tower"][:, 2].round(3))
    assert np.diff(heights).max() < 1.5 * STEP


def test_support_of_curved_layers_has_interface_gap_and_clearance(part):
    """The underside of the arch is flat: so deep below it lies what is laid, and so full is it."""
    mesh, layers, support = part
    gap, clearance = 0.8, 2.0
    process = Process(support_interface=3, support_gap=gap, support_clearance=clearance)
    machine = Machine(kinematics=Kinematics("three_axes"), process=process)
    text = gcode(plan_print(Toolpaths.empty(), layers, mesh, machine, support=support), machine)
    rows, kinds = moves(text)
    lift = -support.columns.mesh.points[:, 2].min()
    props = kinds == "Support material"
    depth, volume = lift - rows[props, 2], 0.25 * np.pi * 1.75**2 * rows[props, 6]
    assert depth.min() > gap - 2e-3
    near = (depth < gap + 2.5 * STEP) & (depth > gap)
    far = (depth > gap + 4.5 * STEP) & (depth < gap + 6.5 * STEP)
    assert volume[near].sum() == pytest.approx(300.0 * 2.5 * STEP, rel=0.2)
    assert volume[far].sum() == pytest.approx(300.0 * 2.0 * STEP / 3.0, rel=0.2)
    # Seen from above, layers of the part lie beside those of the support at their level.
    for asked, least, most in ((clearance, 1.0, 1.1), (0.0, 0.0, 1.0)):
        machine = Machine(process=Process(support_clearance=asked))
        paths = support_paths(support, machine, layers=layers)
        apart = []
        for number, before in enumerate(support.before.tolist()):
            mine = shapely.MultiLineString([line[:, :2] for line in paths.on_layer(number)])
            shapes = shapely.polygons(layers[before].points[layers[before].triangles][:, :, :2])
            beside = shapely.union_all(shapes)
            if len(paths.on_layer(number)) and not shapely.intersects(mine, beside):
                apart.append(shapely.distance(mine, beside) - 0.5 * machine.matrix_width)
        assert least * asked - 0.02 < min(apart) < most * asked + 0.5 * machine.matrix_width


def test_support_below_flat_layers_is_refused_where_nothing_hangs_over():
    """Nothing is solved before: this part has neither loads nor supports."""
    problem = Problem(box_mesh((30.0, 10.0, 6.0), (3, 1, 1)), isotropic(1.0, 0.3), (), {})
    with pytest.raises(InputError, match="support is laid in a print"):
        compare("cantilever", ["zigzag"], support=True)
    with pytest.raises(InputError, match="no face of the part hangs over by more than 45 degrees"):
        compare(Case("flat", "", problem), ["zigzag"], support=True, print_plans=True)


def test_layers_without_a_field_are_not_propped_in_the_file(part):
    """Those of the slicer `surfaces`, say: their support was left out without a word."""
    mesh, layers, _ = part
    problem = Problem(mesh, isotropic(1.0, 0.3), (), {})
    solved = Solved(
        Case("curved", "", problem), SimpleNamespace(heaviest=SimpleNamespace(mesh=mesh))
    )
    with pytest.raises(InputError, match="were given without one: leave out support"):
        solved.cut(lambda *_: layers, support=True)


def test_layers_that_look_down_are_stood_up(part):
    """Half a tube about y, cut in layers along its radius: from x its upper half looks down."""
    mesh, layers, _ = part
    assert standing(layers, (0.0, 0.0, 2.0)) == (0.0, 0.0, 1.0)
    up = np.array(standing(layers, (1.0, 0.0, 0.0)))
    np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=0.02)
    flat = Planar(count=3).cut(mesh)
    assert standing(flat, (1.0, 0.0, 0.0)) == (1.0, 0.0, 0.0)
    plan = plan_print(Toolpaths.empty(), layers, mesh, Machine(), build=(1.0, 0.0, 0.0))
    assert any("upwards" in line for line in plan.warnings)
    assert any("--support" in line for line in plan.warnings)
