"""A print on curved layers: files for five axes, followed by another library's rotations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.machine import Kinematics, Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.export.gcode import gcode
from ccfem.printing.part_moves import part_moves
from ccfem.printing.poses import limited_tilt
from ccfem.printing.print_plan import plan_print
from ccfem.printing.together import arranged
from ccfem.slicing.layers.level_surfaces import level_surfaces

MACHINE = Machine(filament_area=0.05, minimum_length=30.0, cutter_distance=30.0)
CENTRE = (150.0, 150.0, -30.0)


@pytest.fixture(scope="module")
def part():
    """Layers of a part that bend by 20 degrees, with two strands on each."""
    mesh = box_mesh((40.0, 20.0, 12.0), (20, 10, 6))
    x, _, z = mesh.points.T
    layers = level_surfaces(
        mesh, z - 0.009 * (x - 20.0) ** 2, np.array([3.0, 4.0]), 1.0, 1.0, 5.0
    ).layers
    parts = []
    for layer in layers:
        lines, normals = [], []
        for y in (8.0, 12.0):
            points = np.column_stack([np.linspace(2, 38, 73), np.full(73, y), np.full(73, 5.0)])
            for _ in range(20):
                found = nearest_on_triangles(layer.points, layer.triangles, points)
                points[:, 2] = found.points[:, 2]
            corners = layer.point_normals[layer.triangles[found.triangle]]
            across = np.einsum("qk,qkd->qd", found.weights, corners)
            normals.append(across / np.linalg.norm(across, axis=1, keepdims=True))
            lines.append(found.points)
        parts.append(Toolpaths.in_space(lines, normals, layer))
    return mesh, layers, Toolpaths.concatenate(parts)


def words(text):
    """Every G0 and G1 of a file: what all axes stand at after it, what it feeds, its rate, tool."""
    at, rate, tool, rows = dict.fromkeys("XYZABC", 0.0), 0.0, 0, []
    for line in text.splitlines():
        code = line.split(";")[0].split()
        if code and code[0] in ("T0", "T1"):
            tool = int(code[0][1])
        if code and code[0] in ("G0", "G1"):
            given = {word[0]: float(word[1:]) for word in code[1:]}
            at = {**at, **{key: value for key, value in given.items() if key in at}}
            rate = given.get("F", rate)
            rows.append((*at.values(), given.get("E", 0.0), rate, tool, code[0] == "G0"))
    return np.array(rows)


def tips(kind, rows):
    """Tips and directions of the head, in the frame of the part."""
    linear, (a, b, c) = rows[:, :3], rows[:, 3:6].T
    if kind == "table_table":
        table = Rotation.from_euler("zx", np.column_stack([c, a]), degrees=True).inv()
        return table.apply(linear - CENTRE) + CENTRE, table.apply([0.0, 0.0, 1.0])
    head = Rotation.from_euler("yz", np.column_stack([b, c]), degrees=True)
    return linear + np.array([0, 0, 90.0]) - head.apply([0, 0, 90.0]), head.apply([0.0, 0.0, 1.0])


@pytest.mark.parametrize("kind", ["table_table", "head_head"])
def test_five_axes_lay_the_strands_where_they_were_planned(part, kind):
    mesh, layers, paths = part
    machine = replace(MACHINE, kinematics=Kinematics(kind, CENTRE, 90.0))
    plan = plan_print(paths, layers, mesh, machine)
    rows = words(gcode(plan, machine))
    place, axis = tips(kind, rows)
    planned = plan.paths.of_kind(FIBRE)
    assert len(planned) == 4
    lays = (rows[:, 8] == 1) & (rows[:, 9] == 0)
    for line, across in zip(planned, np.split(planned.normals, planned.offsets[1:-1]), strict=True):
        for point, normal in zip(line[1:], across[1:], strict=True):
            off = np.linalg.norm(place[lays] - point, axis=1)
            near = int(off.argmin())
            assert off[near] < 3e-3
            assert axis[lays][near] @ normal > np.cos(np.radians(0.1))
    # Between two rows the axes move evenly; the nozzle stays within a twentieth of its way.
    halfway, _ = tips(kind, 0.5 * (rows[1:] + rows[:-1]))
    off = np.linalg.norm(halfway - 0.5 * (place[1:] + place[:-1]), axis=1)
    assert off[lays[1:] & lays[:-1]].max() < 0.02
    # Rate: along X, Y and Z; along the part it is one of those of the process.
    way = np.linalg.norm(np.diff(rows[:, :3], axis=0), axis=1)
    along = np.linalg.norm(np.diff(place, axis=0), axis=1)
    moved = lays[1:] & (along > 0.2)
    speed = along[moved] / (way[moved] / (rows[1:, 7][moved] / 60.0))
    assert speed.min() == pytest.approx(MACHINE.process.start_speed, rel=0.02)
    assert speed.max() <= MACHINE.fibre_speed * 1.02
    # What is fed: tail, 1 mm, and the way to the cut, for each strand; the first one lies on a bar.
    fed = rows[rows[:, 8] == 1][:, 6].sum()
    assert fed == pytest.approx(planned.lengths.sum() + 30.0 + 20.0 + 5 * 1.0, abs=0.05)


def test_nothing_travels_through_what_is_printed(part):
    mesh, layers, paths = part
    machine = replace(MACHINE, kinematics=Kinematics("head_head", CENTRE, 90.0))
    rows = words(gcode(plan_print(paths, layers, mesh, machine), machine))
    place, _ = tips("head_head", rows)
    highest, seen = 0.0, 0
    for k in range(2, len(rows)):
        step = place[k] - place[k - 1]
        if rows[k, 9] == 0 and np.linalg.norm(step) > 0.0:
            highest = max(highest, place[k, 2])
        elif rows[k, 9] == 1 and np.linalg.norm(step[:2]) > 2.0:
            assert min(place[k, 2], place[k - 1, 2]) > highest + 0.95 * machine.gcode.lift
            seen += 1
    assert seen > 4


def test_layers_come_out_full(part):
    mesh, layers, paths = part
    machine = replace(MACHINE, kinematics=Kinematics("head_head"))
    plan = plan_print(paths, layers, mesh, machine)
    room = sum(float(k.areas @ k.local_thickness[k.triangles].mean(axis=1)) for k in layers)
    assert plan.volume(machine) == pytest.approx(room, rel=0.05)


def test_an_upright_head_lays_what_it_does_not_touch(part):
    mesh, layers, paths = part
    plan = plan_print(paths, layers, mesh, MACHINE)
    rows = words(gcode(plan, MACHINE))
    assert not rows[:, 3:6].any()
    assert np.ptp(rows[rows[:, 8] == 1][:, 2]) > 2.0
    with pytest.raises(InputError, match=r"tilt by up to 19 degrees, .* touches those above 12"):
        plan_print(paths, layers, mesh, replace(MACHINE, head_angle=78.0))
    short = replace(MACHINE.process, short="error")
    long = replace(MACHINE, minimum_length=60.0, process=short)
    with pytest.raises(
        InputError, match=r"no shorter than the 60 mm of machine.minimum_length; 4 of 4"
    ):
        plan_print(paths, layers, mesh, long)


def test_the_tilt_has_a_limit():
    tilt, turn = np.radians([0.0, 10.0, 40.0, 80.0]), np.radians([0.0, 30.0, 100.0, 250.0])
    sine = np.sin(tilt)
    normals = np.column_stack([sine * np.cos(turn), sine * np.sin(turn), np.cos(tilt)])
    found = limited_tilt(normals, 30.0)
    angle = np.degrees(np.arccos(np.clip(found[:, 2], -1, 1)))
    np.testing.assert_allclose(angle, [0.0, 10.0, 30.0, 30.0], atol=1e-6)
    heading = np.arctan2(found[1:, 1], found[1:, 0]) % (2 * np.pi)
    np.testing.assert_allclose(heading, turn[1:], atol=1e-9)


def slanted():
    """Layers that rise by 17 degrees, so that the high end of a copy faces the low end of one."""
    mesh = box_mesh((40.0, 12.0, 12.0), (10, 3, 3))
    x, _, z = mesh.points.T
    levels = np.array([4.0, 5.0, 6.0])
    layers = level_surfaces(mesh, z - 0.3 * (x - 20.0), levels, 1.0, 1.0, 5.0).layers
    parts = []
    for layer in layers:
        low, high = layer.points.min(axis=0), layer.points.max(axis=0)
        ends = np.add([low, high], [[2.0, 6.0, 0.6], [-2.0, -6.0, -0.6]])
        line = np.linspace(*ends, 41)
        parts.append(Toolpaths.in_space([line], [np.tile(layer.normals[0], (41, 1))], layer))
    return Toolpaths.concatenate(parts), layers, mesh


@pytest.mark.parametrize("kind", ["three_axes", "head_head"])
def test_copies_stand_as_far_apart_as_the_head_needs_and_hardly_more(kind):
    """No point of one copy lies in the cone of the head anywhere near the other."""
    machine = replace(MACHINE, kinematics=Kinematics(kind, CENTRE, 90.0))
    plan = plan_print(*slanted(), machine)
    whole = arranged([plan], [BedLayout(copies=(2, 1))], machine)
    moves = part_moves(whole, machine)
    left, right = whole.standing
    gap = right.low[0] - left.high[0]
    axes = moves.normal if kind == "head_head" else np.tile([0.0, 0.0, 1.0], (len(moves), 1))
    x, laid = moves.place[:, 0], moves.in_part
    beside_it = x < 0.5 * (left.high[0] + right.low[0])

    def touches(nearer):
        found = 0
        for tips, other, way in ((beside_it, ~beside_it, -nearer), (~beside_it, beside_it, nearer)):
            for rows in np.array_split(np.flatnonzero(tips & (x > left.low[0] - 2.0))[::4], 20):
                points = moves.place[: rows[-1]][(other & laid)[: rows[-1]]][::2]
                off = points[None] - np.add(moves.place[rows], [-way, 0.0, 0.0])[:, None]
                along = np.einsum("tpk,tk->tp", off, axes[rows])
                aside = np.sqrt(np.maximum((off**2).sum(axis=2) - along**2, 0.0))
                reach = along * np.tan(np.radians(machine.head_angle))
                found += int(((aside < reach) & (along < machine.head_length)).sum())
        return found

    assert touches(0.0) == 0
    assert touches(2.0) > 0
    assert gap > 4.0 + machine.matrix_width
    with pytest.raises(InputError, match=f"{gap - machine.matrix_width:.3g} mm apart"):
        arranged([plan], [BedLayout(copies=(6, 1))], machine)
    with pytest.raises(InputError, match="head_length"):
        arranged([plan], [BedLayout(copies=(2,))], replace(machine, head_length=8.0))
