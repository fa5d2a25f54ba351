"""What is written can be printed: a small part with every machine, and files that are spoiled.

The numbers come from the file alone, by the printer on paper of `conftest`.
"""

import csv
from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.errors import InputError
from ccfem.export.gcode import gcode
from ccfem.export.robot_cell import write_robot_cell
from ccfem.export.trim_table import write_trims
from ccfem.layers.slicing.planar import Planar
from ccfem.machine import Machine, machine_names, machine_table, updated
from ccfem.mesh.box import box_mesh
from ccfem.printing.duration import durations
from ccfem.printing.moves import FAN, PREHEAT, WORK
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import plan_print
from ccfem.toolpaths import Toolpaths

SIZE = (85.0, 26.0, 1.8)
HEIGHTS = (0.7, 1.3)
HALF = 0.5 * np.array(SIZE[:2])
AREA = SIZE[0] * SIZE[1]
FILAMENT = 0.25 * np.pi * 1.75**2
PART = ("External perimeter", "Solid infill", "Internal infill")


def ring(radius):
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    line = np.array([15.0, 13.0]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    line[-1] = line[0]
    return line


LINES = [
    ring(10.0),
    np.array([[30.0, 3.0], [60.0, 3.0], [78.0, 25.0]]),
    np.array([[26.0, 22.0], [73.0, 22.0]]),
    np.array([[50.0, 18.0], [70.0, 18.0]]),
]


class Print:
    """A part with strands on two layers: its file, what the printer did, and what was planned."""

    def __init__(self, name, follow, values=None, lines=LINES):
        self.name, self.machine = name, updated(Machine(), machine_table(name), values or {})
        mesh = box_mesh(SIZE, (8, 3, 1))
        layers = Planar(heights=HEIGHTS).cut(mesh)
        paths = [Toolpaths.from_plane(lines, layer) for layer in layers]
        self.plan = plan_print(Toolpaths.concatenate(paths), layers, mesh, self.machine)
        self.text = gcode(self.plan, self.machine)
        self.planned = sum(float(path.lengths.sum()) for path in paths)
        centre = 0.5 * np.array(self.machine.gcode.bed[:2])
        self.section = shapely.box(*(centre - HALF), *(centre + HALF))
        self.centre, self.follow = centre, follow
        self.done = self.run()

    def run(self, text=None):
        profile = self.machine.gcode
        unknown = profile.offset if profile.offset_by == "gcode" else (0.0, 0.0, 0.0)
        return self.follow(self.text if text is None else text, self.name, unknown)


@pytest.fixture(scope="module", params=machine_names())
def printed(request, follow):
    return Print(request.param, follow)


def arc(steps):
    return np.cumsum([0.0, *(step.length for step in steps)])


def own(run):
    return {name: steps for name, steps in run.strands().items() if "beside" not in name}


def volume(job, run):
    """Each layer of matrix fills its height, and what the fibre below it leaves."""
    matrix, fibre, machine = {}, {}, job.machine
    for step in run.steps:
        inside = step.lays and step.kind in PART and job.section.covers(shapely.Point(step.end[:2]))
        if inside:
            found = fibre if step.tool or step.kind == "Internal infill" else matrix
            laid = FILAMENT * (step.beside if step.tool else step.fed)
            laid += machine.filament_area * step.length * (step.tool == 1)
            found[step.end[2]] = found.get(step.end[2], 0.0) + laid
    wrong, lower, strands = [], 0.0, 0.0
    for height in sorted({*matrix, *fibre}):
        strands += fibre.get(height, 0.0)
        if height in matrix:
            share = (matrix[height] + strands) / (AREA * (height - lower))
            if not 0.96 < share < 1.04:
                wrong.append(f"layer at {height:g} is {share:.3f} full")
            lower, strands = height, 0.0
    share = (sum(matrix.values()) + sum(fibre.values())) / (AREA * SIZE[2])
    return wrong + ([] if 0.98 < share < 1.02 else [f"the part is {share:.3f} full"])


def feeding(job, run):
    """A strand gets its tail, a little more, and its way to the cut; matrix what was planned."""
    wrong, machine, process = [], job.machine, job.machine.process
    for name, steps in run.strands().items():
        total, fed = sum(s.length for s in steps), sum(s.fed for s in steps)
        wanted = machine.tail + process.restart_extra
        wanted += process.feed_ratio * (total - machine.tail)
        if abs(fed - wanted) > 0.01:
            wrong.append(f"strand {name} of {total:.2f} mm gets {fed:.3f} mm, not {wanted:.3f}")
    paths, area = job.plan.paths, machine.matrix_width / FILAMENT
    lengths = np.append(np.linalg.norm(np.diff(paths.points, axis=0), axis=1), 0.0)
    lengths[paths.offsets[1:] - 1] = 0.0
    layer = np.repeat(paths.layer, np.diff(paths.offsets))
    matrix = np.repeat(paths.kind == 1, np.diff(paths.offsets))
    for number, top in enumerate(job.plan.top.tolist()):
        here = matrix & (layer == number)
        wanted = float((lengths * job.plan.laid)[here].sum()) * area
        fed = sum(
            s.fed
            for s in run.steps
            if s.lays and s.tool == 0 and s.kind in PART and abs(s.end[2] - top) < 1e-6
        )
        if abs(fed - wanted) > 1e-3 * wanted + 1e-9:
            wrong.append(f"matrix at {top:g} gets {fed:.3f} mm, not {wanted:.3f}")
    return wrong


def speeds(job, run):
    """Slow at the start, at corners, in turns and behind the cut."""
    wrong, machine, process = [], job.machine, job.machine.process
    for name, steps in run.strands().items():
        steps = [step for step in steps if step.length]
        along, most = arc(steps), machine.process.speed_limit or np.inf
        fast = max(step.speed for step in steps)
        if fast > min(most, machine.fibre_speed) + 1e-6:
            wrong.append(f"strand {name} is laid at {fast:g} mm/s")
        ways = [(s.end - s.start) / s.length for s in steps]
        corners = [
            along[k + 1]
            for k in range(len(ways) - 1)
            if ways[k] @ ways[k + 1] < np.cos(np.radians(process.corner_angle))
        ]
        radius = {
            np.linalg.norm(s.end[:2] - job.centre - [15.0, 13.0] + HALF).round(1) for s in steps
        }
        bend = 10.0 if radius == {10.0} else np.inf
        bent = (bend - machine.minimum_radius) / (process.bend_radius - machine.minimum_radius)
        allowed = process.start_speed + min(bent, 1.0) * (machine.fibre_speed - process.start_speed)
        cut = along[-1] - machine.tail
        for step, start, end in zip(steps, along[:-1], along[1:], strict=True):
            near, middle = process.corner_length - 0.01, 0.5 * (start + end)
            slow = start < process.start_length - 0.01
            slow |= any(start < at + near and end > at - near for at in corners)
            limit = process.start_speed if slow else allowed * 1.01
            limit = min(limit, process.finish_speed if middle > cut else np.inf)
            if step.speed > limit + 1e-6:
                wrong.append(f"strand {name} at {middle:.1f} mm: {step.speed:g} > {limit:g} mm/s")
    return wrong


def heat(job, run):
    """Nothing is fed by a tool that was not waited for, and the other one cools."""
    wrong, machine = [], job.machine
    work = (machine.matrix_temperature, machine.fibre_temperature)
    standby = (machine.matrix_standby, machine.fibre_standby)
    for step in run.steps:
        ready = step.waited and step.heat >= max(work[max(step.tool, 0)], 170.0)
        if (step.fed > 0.0 or step.lays) and not ready:
            wrong.append(f"tool {step.tool} lays at {step.heat:g} degrees: step {step.number}")
    for change in run.changes:
        if change.old >= 0 and change.told > standby[change.old]:
            wrong.append(f"tool {change.old} stays at {change.told:g} degrees")
    return wrong


def changes(job, run):
    """Up, drawn back, given back, and primed beside the part."""
    wrong, debt = [], 0.0
    for step in run.steps:
        debt -= step.fed if step.tool == 0 and not step.length else 0.0
        if step.lays and step.tool == 0 and abs(debt) > 1e-4:
            wrong.append(f"{debt:g} mm are not given back at step {step.number}")
            break
    for change in run.changes[1:]:
        if change.z < change.highest + 5.0 - 1e-6:
            wrong.append(f"tool {change.new} is taken at {change.z:g} over {change.highest:g}")
    for change in run.changes:
        laid = 0.0
        for step in run.steps[change.at :]:
            if step.lays and (step.kind in PART or step.tool != change.new):
                break
            laid += step.fed * FILAMENT if step.lays else 0.0
        if change.new == 0 and laid < 10.0:
            wrong.append(f"{laid:.1f} mm3 are primed before the part")
    return wrong


class HeightMap:
    """How high what is laid stands, on cells of half a millimetre."""

    def __init__(self, bed):
        self.top = np.zeros(tuple(int(2 * size) + 2 for size in bed[:2]))

    def cells(self, start, end, half=0.0):
        count = max(int(np.ceil(np.linalg.norm(end - start) / 0.25)), 1)
        line = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start)
        side = np.array([[x, y] for x in (-half, 0, half) for y in (-half, 0, half)])
        at = np.floor(2.0 * (line[:, None, :2] + side)).astype(int).reshape(-1, 2)
        return tuple(np.clip(at, 0, np.array(self.top.shape) - 1).T)

    def lay(self, step, width):
        at = self.cells(step.start, step.end, 0.4 * width)
        self.top[at] = np.maximum(self.top[at], step.end[2])


def travel(job, run):
    """Above all that is laid, and never with fibre that was not cut."""
    wrong, lift = [], job.machine.gcode.lift
    area, hanging = HeightMap(job.machine.gcode.bed), False
    for step in run.steps:
        if step.lays:
            area.lay(step, 0.8)
        sideways = step.length and np.abs(step.end - step.start)[:2].max() > 0.0
        if step.rapid and sideways and step.number > 1:
            over = area.top[area.cells(step.start, step.end)].max()
            if min(step.start[2], step.end[2]) < over + 0.95 * lift:
                wrong.append(f"travel at {step.end[2]:g} over {over:g}: step {step.number}")
        hanging = (hanging or (step.tool == 1 and step.fed > 0.0)) and step.number not in run.cuts
        if step.tool == 1 and step.cut:
            hanging = False
        if step.rapid and hanging:
            wrong.append(f"fibre is dragged by step {step.number}")
            hanging = False
    return wrong


def support(job, run):
    """Fibre has something below it, but for .5 % and short spans."""
    area, free, total, runs, span = HeightMap(job.machine.gcode.bed), 0.0, 0.0, [0.0], 0.0
    layer = job.machine.strand_height
    below = area.top
    for k, step in enumerate(run.steps):
        if step.rapid or step.tool == 0:
            span = 0.0
        if k and step.tool != run.steps[k - 1].tool and step.tool == 1:
            below = area.top.copy()
        if step.lays and step.tool == 1:
            count = max(int(step.length / 0.5), 1)
            for part in np.linspace(0.0, 1.0, count + 1)[1:]:
                at = step.start + part * (step.end - step.start)
                there = below[area.cells(at, at, 0.2)].max()
                held = there >= step.end[2] - 1.6 * layer - 1e-6
                total += step.length / count
                free += 0.0 if held else step.length / count
                span = 0.0 if held else span + step.length / count
                runs.append(span)
        if step.lays:
            area.lay(step, 0.8)
    wrong = [f"{free / total:.3f} of the fibre has nothing below"] if free > 0.005 * total else []
    return wrong + ([f"a span of {max(runs):.1f} mm"] if max(runs) > 3.0 else [])


def bed(job, run):
    """Both nozzles over the bed wherever either of them works."""
    place = np.array([step.end for step in run.steps if step.number > 1])
    low, high = place.min(axis=0), place.max(axis=0)
    offset = np.array(job.machine.gcode.offset)
    fibre = np.array([step.end for step in run.steps if step.tool == 1]) - [*offset[:2], 0.0]
    low, high = np.minimum(low, fibre.min(axis=0)), np.maximum(high, fibre.max(axis=0))
    inside = (low >= 0.0).all() and (high <= job.machine.gcode.bed).all()
    return [] if inside else [f"nozzles reach {low} to {high}"]


def cuts(job, run):
    """One cut a strand, the tail before its end, with no feed behind it; none too short."""
    wrong, machine = [], job.machine
    strands = run.strands()
    if len(run.cuts) != len(strands):
        wrong.append(f"{len(run.cuts)} cuts in {len(strands)} strands")
    for name, steps in strands.items():
        along = arc(steps)
        at = [along[k] for k, step in enumerate(steps) if step.cut][:1] or [along[-1]]
        if abs(along[-1] - at[0] - machine.tail) > 0.05:
            wrong.append(f"strand {name} of {along[-1]:.2f} mm is cut at {at[0]:.2f}")
        if any(step.fed for step in steps if step.cut):
            wrong.append(f"strand {name} is fed behind its cut")
        if along[-1] < machine.minimum_length - 0.01:
            wrong.append(f"strand {name} is {along[-1]:.2f} mm long")
    return wrong


def amount(job, run):
    """Fibre, matrix in its place and what is left out are what was planned."""
    fibre = sum(sum(s.length for s in steps) for steps in own(run).values())
    short = sum(s.length for s in run.steps if s.lays and s.tool == 0 and s.kind == PART[2])
    found = fibre + short + job.plan.dropped
    return [] if abs(found / job.planned - 1.0) < 1e-3 else [f"{found:g} of {job.planned:g} mm"]


def places(job, run):
    """Strands lie where they were planned."""
    lines = [line + job.centre - HALF for line in LINES]
    shapes = shapely.linestrings(
        np.concatenate(lines), indices=np.repeat(range(4), list(map(len, lines)))
    )
    wrong = []
    for name, steps in own(run).items():
        points = np.array([steps[0].start, *(step.end for step in steps)])
        line = shapely.LineString(points[:, :2])
        off = min(shapely.hausdorff_distance(line, shape) for shape in shapes)
        heights = {abs(points[:, 2] - top).max() for top in np.array(HEIGHTS) + half_strand(job)}
        if off > 1.5e-3 or min(heights) > 1e-3:
            wrong.append(f"strand {name} lies {off:.3f} mm off, {min(heights):.3f} mm in height")
    return wrong


def half_strand(job):
    return 0.5 * job.machine.strand_height


def words(job, run):
    return run.wrong


CHECKS = (
    *(volume, feeding, speeds, heat, changes, travel, support, bed, cuts, amount, places, words),
)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_a_part_prints_with_every_machine(printed, check):
    assert check(printed, printed.done) == []


# Two strands joined by a loop 11 mm outside the part; a span of 30 mm over nothing.
LOOP = np.concatenate(
    [
        [[40.0, 8.0]],
        [85.0, 13.0] + 5.0 * np.array([[np.sin(a), -np.cos(a)] for a in np.linspace(0, np.pi, 25)]),
        [[40.0, 18.0]],
    ]
)
LOOP[1:-1, 0] += 6.0


@pytest.fixture(scope="module")
def outside(follow):
    return Print("marlin_two_tools", follow, lines=[LOOP])


def test_loops_outside_lie_on_pads(outside, tmp_path):
    assert support(outside, outside.done) == []
    assert [check(outside, outside.done) for check in (travel, cuts, heat, bed, volume)] == [[]] * 5
    pads = [s for s in outside.done.steps if s.lays and s.kind == "Support material"]
    corner = outside.centre - HALF
    place = np.array([step.end for step in pads])
    assert {round(z, 3) for z in place[:, 2]} == {0.2, 0.646, 1.246}
    # Clear of the part by .7 mm, a line's middle .4 more; round the loop by half a strand and 1 mm.
    assert place[:, 0].min() - corner[0] > SIZE[0] + 1.1 - 0.05
    assert place[:, 0].max() - corner[0] == pytest.approx(85.0 + 6.0 + 5.0 + 1.5 - 0.4, abs=0.1)
    # The knife's places: four, where the strands cross the border at x = 85.
    trims = outside.plan.trims
    np.testing.assert_allclose(trims[:, 1] - corner[0], 85.0, atol=1e-3)
    np.testing.assert_allclose(np.sort(trims[:, 2] - corner[1]), [8, 8, 18, 18], atol=0.01)

    write_trims(tmp_path / "trim.csv", outside.plan)
    rows = np.loadtxt(tmp_path / "trim.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 1:3], trims[:, 1:], atol=1e-3)
    tops = np.array(HEIGHTS) + half_strand(outside)
    np.testing.assert_allclose(np.unique(rows[:, 3]), tops, atol=1e-3)


def test_a_strand_along_the_border_has_a_pad_that_touches(follow):
    # Half a millimetre outside, in the gap that pads leave elsewhere: nothing would hold it.
    line = np.array([[20.0, -0.5], [75.0, -0.5]])
    job = Print("marlin_two_tools", follow, lines=[line])
    assert support(job, job.done) == []
    edge = (job.centre - HALF)[1]
    pads = np.array([s.end for s in job.done.steps if s.lays and s.kind == "Support material"])
    for z in np.unique(pads[:, 2]):
        gap = edge - pads[pads[:, 2] == z][:, 1].max() - 0.4
        assert gap == pytest.approx(0.0 if z > 0.3 else 0.7, abs=0.05)


def test_without_pads_the_loops_hang(outside):
    found, kind = [], ""
    for line in outside.text.splitlines():
        kind = line if line.startswith(";TYPE") else kind
        pad = kind == ";TYPE:Support material" and line.startswith("G1 X")
        found.append("G0" + line[2:].split(" E")[0] if pad else line)
    hanging = support(outside, outside.run("\n".join(found)))
    assert any("a span of" in line for line in hanging)


def test_loops_outside_are_cut_or_refused(follow):
    cut = Print("marlin_two_tools", follow, {"process": {"turns": "cut"}}, [LOOP])
    assert support(cut, cut.done) == cuts(cut, cut.done) == amount(cut, cut.done) == []
    assert len(own(cut.done)) == 4
    assert all(
        cut.section.buffer(1e-3).covers(shapely.Point(s.end))
        for s in cut.done.steps
        if s.lays and s.tool == 1 and not s.strand.startswith("beside")
    )
    with pytest.raises(InputError, match=r"leave fibre layer 0 in 2 places, but process\.turns"):
        Print("marlin_two_tools", follow, {"process": {"turns": "inside"}}, [LOOP])


def strip(height, values, follow):
    """A strip of 60 x 20 mm with strands a width apart on a tenth of it, in its middle."""
    mesh, machine = box_mesh((60.0, 20.0, height), (6, 2, 1)), updated(Machine(), values)
    layers = Planar(count=1).cut(mesh)
    # Four strands on top of each other.
    stack = [np.array([[4.0, 10.0], [56.0, 10.0 + 0.01 * k]]) for k in range(4)]
    return plan_print(Toolpaths.from_plane(stack, layers[0]), layers, mesh, machine)


def test_thin_matrix_and_thin_cover_are_said_or_refused(follow):
    # Stacks of .43 mm, spread over two widths: higher than the matrix above, on a few hundredths.
    (said, *_) = strip(0.5, {}, follow).warnings
    assert "strands stand higher than the 0.196 mm of matrix above them on " in said
    assert 0.01 < 0.01 * float(said.split("them on ")[1].split("%")[0]) < 0.1
    below = strip(2.0, {}, follow).warnings
    assert below == ()
    assert sum("one layer of matrix" in line for line in strip(0.5, {}, follow).warnings) == 2
    with pytest.raises(InputError, match=r"0\.146 mm of matrix below the first fibre layer do not"):
        strip(0.4, {"process": {"short": "drop"}}, follow)


def test_the_checks_see_what_there_is_to_see(printed):
    run = printed.done
    assert len(run.strands()) == 2 * 3 + 1
    assert len(run.changes) == 4 + 1
    assert {step.kind for step in run.steps if step.lays} >= {*PART, "Wipe tower", "Skirt/Brim"}


SHIFTED = {"gcode": {"offset": [18.0, -2.0, 0.0], "offset_by": "gcode"}}
MUTANTS = {
    "matrix by a twentieth too much": (volume, lambda text: more(text, 1.05)),
    "the first wait for fibre": (heat, lambda text: text.replace("M109 T1 S250\n", "", 1)),
    "the first standby of matrix": (heat, lambda text: text.replace("M104 T0 S100\n", "", 1)),
    "a cut 1 mm early": (cuts, {"cutter_distance": 43.0, "minimum_length": 43.0}),
    "no more than the tail fed": (feeding, {"process": {"restart_extra": 0.0}}),
    "travel .1 mm low": (travel, {"gcode": {"lift": 0.9}, "process": {"strand_lift": 0.0}}),
    "twice the speed at the start": (speeds, {"process": {"start_speed": 4.0}}),
    "corners at any speed": (speeds, {"process": {"corner_length": 0.0}}),
    "tails at any speed": (speeds, {"process": {"finish_speed": 9.0}, "fibre_speed": 5.5}),
    "the offset of the nozzles left out": (places, {"gcode": {"offset_by": "firmware"}}),
    "a short strand lost": (amount, {"process": {"short": "drop"}}),
    "no priming": (changes, {"process": {"prime": "none"}}),
    "4 mm of lift at changes": (changes, {"process": {"tool_lift": 4.0}}),
    "a bed too small": (bed, lambda text: text.replace("G0 X", "G0 X-")),
    "a word of another firmware": (words, lambda text: text.replace("M280", "M340")),
    "half a strand in the air": (support, lambda text: text.replace("Z0.754", "Z1.154")),
}


def more(text, factor):
    """Feed more by all lines of matrix, nothing else."""
    found, tool = [], ""
    for line in text.splitlines():
        tool = line if line in ("T0", "T1") else tool
        words = line.split(" E")
        if tool == "T0" and line.startswith("G1 ") and " E" in line and "X" in line:
            fed, _, rest = words[1].partition(" ")
            line = f"{words[0]} E{factor * float(fed):.5f} {rest}"
        found.append(line)
    return "\n".join(found)


@pytest.fixture(scope="module")
def sound(follow):
    """A print whose firmware does not know the offset of the nozzles."""
    return Print("marlin_two_tools", follow, SHIFTED)


@pytest.mark.parametrize("name", MUTANTS)
def test_a_spoiled_file_is_seen(sound, follow, name):
    check, spoil = MUTANTS[name]
    assert check(sound, sound.done) == []
    if isinstance(spoil, dict):
        table = {**SHIFTED, **spoil}
        table["gcode"] = {**SHIFTED["gcode"], **spoil.get("gcode", {})}
        text = Print("marlin_two_tools", follow, table).text
    else:
        text = spoil(sound.text)
    assert text != sound.text
    assert check(sound, sound.run(text)) != []


CELL = 0.02


def seconds(run, most, deviation):
    """Time of a run by its phase plane: squares of the speed at the ends of small cells.

    Between corners nothing but the acceleration bounds the change of the square; in a corner the
    nozzle is on the arc that leaves it by the deviation.
    """
    total, chain = 0.0, []

    def finished():
        if not chain:
            return 0.0
        cells, square = [], [0.0]
        for k, step in enumerate(chain):
            count = int(np.ceil(step.length / CELL)) + 1
            if k:
                ways = [(s.end - s.start) / s.length for s in (chain[k - 1], step)]
                half = 0.5 * np.arccos(np.clip(ways[0] @ ways[1], -1.0, 1.0))
                radius = deviation / max(1.0 / max(np.cos(half), 1e-9) - 1.0, 1e-12)
                square[-1] = min(square[-1], step.speed**2, most * radius)
            cells += [step.length / count] * count
            square += [step.speed**2] * count
        square[-1] = 0.0
        for k in range(1, len(square)):
            square[k] = min(square[k], square[k - 1] + 2.0 * most * cells[k - 1])
        for k in range(len(square) - 2, -1, -1):
            square[k] = min(square[k], square[k + 1] + 2.0 * most * cells[k])
        speed = np.sqrt(square)
        return float((2.0 * np.array(cells) / (speed[1:] + speed[:-1])).sum())

    for step in run.steps[2:]:
        if step.length and step.number not in run.cuts:
            chain.append(step)
            continue
        total += finished() + (0.0 if step.length else abs(step.fed) / step.speed)
        chain = [step] if step.length else []
    return total + finished() + run.waited


def test_the_time_is_that_of_another_estimator(follow):
    # Tools that heat at once: the wait for them has a test of its own.
    hot = {"matrix_heating": 1e9, "fibre_heating": 1e9, "process": {"acceleration": 20.0}}
    job = Print("marlin_two_tools", follow, hot)
    process = job.machine.process
    found = seconds(job.done, process.acceleration, process.junction)
    assert float(job.done.head["TIME"]) == pytest.approx(found, rel=0.01)
    # It does matter: without acceleration the same moves take less.
    plain = sum((s.length or abs(s.fed)) / s.speed for s in job.done.steps[2:]) + job.done.waited
    assert plain < 0.95 * found


def test_a_waiting_tool_is_hot_in_time(follow):
    # 100 K at 10 K/s: 10 s ahead; the fibre's 70 K at 1.38 K/s take 51 s, less than its break.
    job = Print("marlin_two_tools", follow, {"matrix_heating": 10.0})
    moves = part_moves(job.plan, job.machine)
    spent = durations(moves, job.machine)
    begin = np.cumsum(spent) - spent
    works = np.flatnonzero(moves.event == WORK)
    for tool, need in ((0, 10.0), (1, 70.0 / 1.38)):
        preheats = np.flatnonzero((moves.event == PREHEAT) & (moves.tool == tool))
        mine = [k for k in works.tolist() if moves.tool[k] == tool][1 - tool :]
        assert len(preheats) == len(mine) == 2
        for early, late in zip(preheats.tolist(), mine, strict=True):
            gap = begin[late] - begin[early]
            assert need <= gap <= need + spent[early + 1] + 1e-9
            assert spent[late] == pytest.approx(0.0, abs=1e-6)
            assert moves.amount[early] == moves.amount[late]
    # Without it the printer waits as long as the tool had cooled, at most 10 s here.
    cold = replace(moves, event=np.where(moves.event == PREHEAT, FAN, moves.event))
    waits = durations(cold, job.machine)[(moves.event == WORK) & (moves.tool == 0)]
    np.testing.assert_allclose(waits, [0.0, 10.0, 10.0], atol=1e-6)


def test_the_head_says_what_is_used(printed):
    head, machine = printed.done.head, printed.machine
    steps = printed.done.steps
    fibre = sum(step.fed for step in steps if step.tool == 1)
    matrix = sum(step.fed for step in steps if step.tool == 0) + sum(s.beside for s in steps)
    said = [float(one) for one in head["filament used [mm]"].split(",")]
    np.testing.assert_allclose(said, [matrix, fibre], atol=0.02)
    grams = [float(one) for one in head["filament used [g]"].split(",")]
    tex = machine.fibre_tex or machine.filament_area * machine.fibre_density * 1000.0
    np.testing.assert_allclose(grams, [matrix * FILAMENT * 1.24e-3, fibre * tex * 1e-6], atol=2e-3)
    clock = head["estimated printing time (normal mode)"].split()
    parts = [float(one[:-1]) * {"h": 3600, "m": 60, "s": 1}[one[-1]] for one in clock]
    assert sum(parts) == float(head["TIME"])
    assert int(head["LAYER_COUNT"]) == len(printed.plan.top)
    assert head["too short for the cutter"].startswith("40.0 mm in 2 strands are laid") == (
        machine.strand_height >= 0.1
    )
    low = np.array([float(head[f"MIN{axis}"]) for axis in "XYZ"])
    laid = np.array([step.end for step in steps if step.lays])
    np.testing.assert_allclose(laid.min(axis=0), low, atol=1e-3)


def test_a_cell_of_robots_lays_the_same(printed, tmp_path):
    write_robot_cell(tmp_path / "cell.csv", part_moves(printed.plan, printed.machine))
    with (tmp_path / "cell.csv").open() as file:
        rows = list(csv.DictReader(file))
    place = np.array([[float(row[axis]) for axis in "xyz"] for row in rows])
    way = np.linalg.norm(np.diff(place, axis=0, prepend=place[:1]), axis=1)
    strand = np.array([int(row["path"]) for row in rows])
    lay = np.array([row["event"] == "lay" for row in rows])
    for number, steps in enumerate(own(printed.done).values()):
        here = lay & (strand == number)
        points = np.array([step.end for step in steps if step.length])
        np.testing.assert_allclose(place[here], points, atol=1e-3)
        feed = [float(row["feed"]) for row, mine in zip(rows, here, strict=True) if mine]
        assert np.dot(feed, way[here]) == pytest.approx(
            sum(step.fed for step in steps if step.length), abs=1e-3
        )
    events = [row["event"] for row in rows]
    assert events.count("cut") == len(printed.done.cuts) == events.count("start")
    assert events.count("tool 0") == events.count("tool 1") + 1 == 3
    assert {(row["nx"], row["ny"], row["nz"]) for row in rows} == {("0", "0", "1")}
