"""Walls, skins and infill as they are laid: by the printer on paper, and by the old lines."""

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.infill import beyond, bridges, regions_of, volumes
from benchmarks.print_checks.job import PART, Job, Lines
from benchmarks.print_checks.motion import travel
from ccfem.body.mesh.box import box_mesh
from ccfem.geometry.hatch import zigzag
from ccfem.geometry.offsets import offset_rings
from ccfem.geometry.shapes import corners_only
from ccfem.machine import Machine, machine_table, updated
from ccfem.paths.plastic import Plastic
from ccfem.paths.splitting.slabs import slabs_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.bed_layout import Place
from ccfem.printing.export.gcode import gcode
from ccfem.printing.matrix_lines import gap_lines, matrix_fills
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar

SIZE = (70.0, 32.0, 12.0)
LINES = [np.array([[2.0, y], [68.0, y]]) for y in (0.5, 16.0, 25.0)]
MACHINE = updated(Machine(), machine_table("marlin_two_tools"))


class Box(Job):
    """A box with strands on one layer, one of them along a wall."""

    def __init__(self, plastic):
        mesh = box_mesh(SIZE, (7, 4, 2))
        layers = Planar(heights=(6.0,)).cut(mesh)
        paths = Toolpaths.from_plane(LINES, layers[0])
        plan = plan_print(paths, layers, mesh, MACHINE, plastic=plastic)
        middle, half = 0.5 * np.array(MACHINE.gcode.bed[:2]), 0.5 * np.array(SIZE[:2])
        self.whole = shapely.box(*(middle - half), *(middle + half))
        corner = np.append(middle - half, 0.0)
        sections = (lambda _: self.whole, lambda _: self.whole.area)
        about = (MACHINE, plan, gcode(plan, MACHINE), [line + corner for line in paths])
        super().__init__("marlin_two_tools", *about, *sections, float(np.prod(SIZE)))


@pytest.fixture(scope="module")
def box():
    made = {}

    def of(infill):
        if infill not in made:
            plastic = Plastic(infill, 0.25, 2, 2)
            job = Box(plastic)
            made[infill] = job, plastic, regions_of(job, plastic)
        return made[infill]

    return of


@pytest.mark.parametrize(("infill", "close"), [("lines", 0.015), ("grid", 0.03), ("gyroid", 0.01)])
def test_each_region_is_as_full_as_it_should_be(box, infill, close):
    """A grid's lines are far apart; a gyroid is as dense as it should be in the mean of layers."""
    job, plastic, regions = box(infill)
    solid, sparse = volumes(job, regions, plastic.density)
    assert solid == pytest.approx(1.0, abs=0.01)
    assert sparse == pytest.approx(1.0, abs=close)
    assert 0.3 < sum(one.areas[1] for one in regions) / (len(regions) * job.whole.area) < 0.8


@pytest.mark.parametrize(("infill", "spacing"), [("lines", 1.0), ("grid", 2.0), ("gyroid", 1.75)])
def test_nothing_is_laid_in_air_but_bridges(box, infill, spacing):
    job, plastic, regions = box(infill)
    width = MACHINE.matrix_width
    in_infill, in_skins, share = bridges(job, regions)
    bridge = spacing * width / plastic.density
    assert in_infill < width / plastic.density
    assert bridge - 2.0 * width < in_skins < bridge
    assert 0.0 < share < 0.4
    assert beyond(job, regions) < 2e-3


@pytest.mark.parametrize("infill", ["lines", "grid", "gyroid"])
def test_the_nozzle_stays_down_between_lines_of_infill(box, infill):
    """Along the wall: it crosses no line of its layer, and the check finds a way that does."""
    job, *_ = box(infill)
    lines = Lines.of(job.done)
    sparse = (lines.kind == PART[2]) & (lines.tool == 0)
    off = lines.rapid & sparse
    begins = sparse & lines.lays & np.append(False, off[:-1])
    level = np.abs(lines.end[:, 2] - lines.start[:, 2]) < 1e-9
    first = off & level & np.append(False, lines.lays[:-1])
    assert first.sum() > 0.6 * begins.sum() > 20
    assert travel(job, job.done) == []
    text = job.text.splitlines()
    down = max(
        k
        for k, line in enumerate(text)
        if line.startswith("G0 X") and text[k - 1].startswith("G1 X") and "Z" not in line
    )
    middle = 0.5 * np.array(MACHINE.gcode.bed[:2])
    text.insert(down, f"G0 X{middle[0] + 30.0} Y{middle[1] - 14.0}")
    text.insert(down, f"G0 X{middle[0] - 30.0} Y{middle[1] + 14.0}")
    assert any("down at" in one for one in travel(job, job.run("\n".join(text))))


def test_comments_call_infill_what_it_is(box):
    """As viewers know it; on layers of matrix all of it lies where the infill is sparse."""
    job, _, regions = box("lines")
    lines = Lines.of(job.done)
    height, sparse = (
        lines.end[:, 2].round(3),
        lines.lays & (lines.kind == PART[2]) & ~lines.of_fibre,
    )
    assert {one.top for one in regions if one.sparse.any()} == set(height[sparse].tolist())
    for region in regions:
        mine = sparse & (height == region.top)
        if mine.any():
            middle = 0.5 * (lines.start[mine] + lines.end[mine])
            inside = region.sparse[region.pixels(middle[:, :2])]
            assert lines.length[mine][inside].sum() > 0.98 * lines.length[mine].sum()


def test_fibre_cuts_no_wall(box):
    """Walls go round whole on each layer of matrix; on that of fibre there is none."""
    job, _, regions = box("gyroid")
    lines = Lines.of(job.done)
    height, laid = lines.end[:, 2].round(3), lines.lays & lines.in_part & ~lines.beside_part
    (fibre,) = np.unique(height[laid & (lines.tool == 1)])
    assert not (laid & (height == fibre) & (lines.kind == PART[0])).any()
    inner = [
        job.whole.buffer(-(k + 0.5) * MACHINE.matrix_width, join_style="mitre") for k in (0, 1)
    ]
    for region in regions:
        mine = laid & (height == region.top) & (lines.kind == PART[0])
        drawn = shapely.union_all(
            shapely.linestrings(np.stack([lines.start[mine], lines.end[mine]], axis=1)[:, :, :2])
        )
        for ring in inner:
            places = shapely.points(shapely.get_coordinates(ring.boundary.segmentize(1.0)))
            off = shapely.distance(places, drawn)
            # The corners of walls are as round as a line.
            assert off.max() < 0.5 * MACHINE.matrix_width
            assert np.count_nonzero(off > 2e-3) <= 5
    strands = shapely.linestrings(
        np.stack([lines.start, lines.end], axis=1)[laid & (height == fibre)][:, :, :2]
    )
    assert shapely.distance(strands, job.whole.boundary).min() >= 0.5 * MACHINE.fibre_width - 2e-3
    above = next(k for k, one in enumerate(regions) if one.top > fibre)
    sparse = [one.sparse.any() for one in regions[above - 2 : above + 2]]
    assert sparse == [True, False, False, True]


@pytest.mark.parametrize("walls", [1, 2])
def test_a_solid_part_has_the_lines_that_it_always_had(walls):
    """A contour and a zigzag half a line in, less a quarter; further walls move it in."""
    mesh, width = box_mesh((20.0, 12.0, 2.0), (2, 1, 1)), MACHINE.matrix_width
    layers = Planar(heights=(1.0,)).cut(mesh)
    slabs, place = slabs_of(layers, 0.0, 2.0, MACHINE), Place(np.eye(3), np.zeros(3))
    fills = matrix_fills(slabs, layers, mesh, place, MACHINE, Plastic(walls=walls))
    section = corners_only(Planar(heights=(0.1,)).cut(mesh)[0].plane.polygon)
    profile, number = MACHINE.gcode, 0
    assert [fill is None for fill in fills] == [slab.fibre is not None for slab in slabs]
    for fill in fills:
        if fill is None:
            continue
        angle = np.radians((profile.matrix_angle + profile.matrix_turn * number) % 360.0)
        rings = [x for y in offset_rings(section, 0.5 * width, width, width, walls) for x in y]
        lines = rings + zigzag(section, (walls + 0.25) * width, width, width, float(angle))
        gaps, widths = gap_lines(section, lines, width, MACHINE.least_line / MACHINE.line_shape)
        assert fill.sparse == 0
        assert fill.widths == [width] * len(lines) + widths
        for line, expected in zip(fill.lines, lines + gaps, strict=True):
            np.testing.assert_array_equal(line, expected)
        number += 1


@pytest.mark.parametrize("seam", ["behind", "corner"])
def test_walls_begin_at_their_seam(seam):
    """An arrow points along x: its sharpest corner is not where Y is largest."""
    from ccfem.body.meshing import extrude

    arrow = shapely.Polygon([(0.0, 0.0), (20.0, 0.0), (40.0, 8.0), (20.0, 16.0), (0.0, 20.0)])
    mesh = extrude(arrow, 2.0, 10.0)
    layers = Planar(heights=(1.0,)).cut(mesh)
    paths = Toolpaths.from_plane(
        [np.array([[4.0, 8.0], [34.0, 8.0], [34.0, 9.5], [5.0, 9.5]])], layers[0]
    )
    machine = updated(MACHINE, {"minimum_length": 30.0, "cutter_distance": 30.0})
    plan = plan_print(paths, layers, mesh, machine, plastic=Plastic(seam=seam))
    walls = [line for line, closed in zip(plan.paths, plan.paths.closed, strict=True) if closed]
    assert len(walls) >= 2
    for wall in walls:
        expected = wall[np.argmax(wall[:, 1 if seam == "behind" else 0])]
        np.testing.assert_allclose(wall[0], expected, atol=2e-3)


def test_layers_end_where_their_lines_lie():
    """Also at half a micrometre more than whole ones, which rounds either way."""
    mesh = box_mesh((70.0, 32.0, 6.0035), (7, 4, 2))
    layers = Planar(heights=(3.0,)).cut(mesh)
    plan = plan_print(Toolpaths.from_plane(LINES, layers[0]), layers, mesh, MACHINE)
    z = plan.paths.points[plan.paths.offsets[:-1], 2]
    np.testing.assert_array_equal(z, plan.top[plan.paths.layer])
