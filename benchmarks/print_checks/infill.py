"""Walls, skins and infill of printed files: volume by region, bridges, and what lies outside.

Run ``python -m benchmarks.print_checks.infill [PART,...] [MACHINE,...] [--infill gyroid]
[--turned] [--out FOLDER]``. Two walls, three skins, 20 % of infill, fibre in six layers, where
something hangs over on support; turned by 37 degrees and in two copies with ``--turned``. The
regions are found again here, on pixels of VTK's sections of the part: walls by the distance from
their border, skins by what the layers above and below cover. The file is followed by a printer on
paper (`printer`). The columns are those of `Row`. Below stands what is off: a volume by more than
1 %, the time by more than 3 %, a wall that is cut, and the other checks of a printed file. The
folder gets the table (``infill.csv``, ``infill.md``) and a picture of each file.
"""

import argparse
import csv
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from hashlib import blake2b
from pathlib import Path

import numpy as np
import shapely

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.height_map import sampled
from benchmarks.print_checks.job import FILAMENT, PART, Job, Lines
from benchmarks.print_checks.motion import in_air
from benchmarks.print_checks.parts import Part, job_of
from benchmarks.print_checks.planned_parts import part_file
from benchmarks.print_checks.printer import Run
from benchmarks.print_checks.strand_checks import strands_of
from benchmarks.studies import own_parts
from ccfem.cases import read
from ccfem.fem.elasticity import solve
from ccfem.machine import machine_names
from ccfem.paths.plastic import Plastic
from ccfem.printing.bed_layout import AS_IT_STANDS, BedLayout
from ccfem.slicing.slicers.planar import Planar

__all__ = ["Regions", "bridges", "part_of", "regions_of", "volumes"]

PARTS = ("box", "loop", "hook", "lever", "bracket")
TURNED = BedLayout(37.0, copies=(2,))
_PIXEL = 0.25
"""Side of a pixel, in line widths: walls are whole numbers of pixels."""
_ANCHOR, _SLIVER = 2.0, 0.2
"""Reach of skins beyond what they cover, and width of what needs none, in line widths."""
_SAME = 1e-3
"""Area, mm^2, by which sections that are one may differ."""
_STRAIGHT_ON = 0.7
"""Cosine of the turn at a corner, where a line is held by the turn before it."""

BOX = """
name = "box"
material = "pla"
[planform]
outline = [[0, 0], [60, 0], [60, 40], [0, 40]]
height = 50
edge_length = 6
holes = [{centre = [15, 20], radius = 6}, {centre = [45, 20], radius = 6}]
[patches.foot]
rule = "plane"
normal = "-x"
offset = 0
[patches.tip]
rule = "plane"
normal = "x"
offset = 60
[[supports]]
patch = "foot"
[[loads.bend]]
kind = "force"
patch = "tip"
vector = [0, 0, -100]
"""
HOOK = """
name = "hook"
surface = "crane_hook.stl"
edge_length = 4
material = "pla"
[patches.eye]
rule = "cylinder"
point = [4, 70, 0]
axis = "z"
radius = 6
[patches.bowl]
rule = "cylinder"
point = [0, 0, 0]
axis = "z"
radius = 18
[[supports]]
patch = "eye"
[[loads.hang]]
kind = "force"
patch = "bowl"
vector = [0, -100, 0]
"""


def part_of(name: str, plastic: Plastic) -> Part:
    """Solve a part with six layers of fibre."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        if name == "hook":
            own_parts.crane_hook(file.with_name("crane_hook.stl"))
        texts = {"box": BOX, "hook": HOOK}
        if name in texts:
            file.write_text(texts[name], encoding="utf-8")
        case = read(str(file) if name in texts else part_file(name, Path(folder)))
    case = replace(case, slicing=Planar(count=6), plastic=plastic)
    stress = solve(case.printed_problem())
    return Part(case, name, stress[case.problem.cases[0]])


@dataclass(frozen=True)
class Regions:
    """A layer of matrix on pixels: its top, the height that it fills, and its masks.

    Attributes
    ----------
    inside, sparse : (a, b) bool arrays
        Of the section, and of the part of it that is sparse.
    low : (2,) array, mm
        Corner of the pixels.
    pixel : float, mm
    """

    top: float
    height: float
    inside: np.ndarray
    sparse: np.ndarray
    low: np.ndarray
    pixel: float

    def pixels(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels that places (k, 2) lie in."""
        at = np.floor((places - self.low) / self.pixel).astype(int)
        at = np.clip(at, 0, np.array(self.sparse.shape) - 1)
        return at[:, 0], at[:, 1]

    @cached_property
    def areas(self) -> tuple[float, float]:
        """Area of what is solid and of what is sparse, mm^2."""
        whole, sparse = (float(mask.sum()) * self.pixel**2 for mask in (self.inside, self.sparse))
        return whole - sparse, sparse


def regions_of(job: Job, plastic: Plastic) -> list[Regions]:
    """Find the regions of all layers of matrix again."""
    machine, lines = job.machine, Lines.of(job.done)
    width, pixel = machine.matrix_width, _PIXEL * machine.matrix_width
    mine = lines.lays & lines.in_part & ~lines.beside_part
    height = lines.end[:, 2].round(3)
    fibre = np.unique(height[mine & lines.of_fibre])
    tops = np.setdiff1d(np.unique(height[mine]), fibre)
    lower = np.concatenate([[0.0], tops[:-1]])
    levels = np.union1d(np.append(0.0, tops), fibre)
    bottoms = levels[np.searchsorted(levels, tops) - 1]
    sections = [job.section(0.5 * (low + high)) for low, high in zip(bottoms, tops, strict=True)]
    bounds = shapely.bounds(sections)
    low, high = np.nanmin(bounds[:, :2], axis=0) - 2.0, np.nanmax(bounds[:, 2:], axis=0) + 2.0
    count = np.ceil((high - low) / pixel).astype(int)
    x, y = (low[k] + (np.arange(count[k]) + 0.5) * pixel for k in (0, 1))
    masks: list[np.ndarray] = []
    deep: list[np.ndarray] = []
    for k, section in enumerate(sections):
        if k and shapely.area(shapely.symmetric_difference(section, sections[k - 1])) < _SAME:
            masks.append(masks[-1])
            deep.append(deep[-1])
            continue
        for found, shape in (
            (masks, section),
            (deep, shapely.buffer(section, -plastic.walls * width, quad_segs=32)),
        ):
            shapely.prepare(shape)
            found.append(shapely.contains_xy(shape, *np.meshgrid(x, y, indexing="ij")))

    def beyond_border(mask: np.ndarray, distance: float) -> np.ndarray:
        return _deep(mask, pixel, distance) > distance

    known: dict[bytes, np.ndarray] = {}
    regions, n = [], plastic.skins
    reach = (plastic.fibre_skins - 0.5) * machine.highest_matrix(0.0)
    for k, inside in enumerate(masks):
        window = masks[k - n : k + n + 1] if n <= k < len(masks) - n else []
        bare = inside & ~(np.logical_and.reduce(window) if window else np.zeros_like(inside))
        sliver = 0.5 * _SLIVER * width
        near = (fibre - machine.strand_height - tops[k] < reach) & (bottoms[k] - fibre < reach)
        sparse = np.zeros_like(inside)
        if not near.any():
            key = blake2b(np.packbits([inside, bare]).tobytes()).digest()
            if key not in known:  # layers of one section are one
                skin = beyond_border(bare, sliver)
                known[key] = deep[k] & beyond_border(~skin, _ANCHOR * width + sliver)
                known[key] &= ~beyond_border(~beyond_border(known[key], width), width)
            sparse = known[key]
        regions.append(Regions(tops[k], tops[k] - lower[k], inside, sparse, low, pixel))
    return regions


def _deep(mask: np.ndarray, pixel: float, most: float) -> np.ndarray:
    """Distance of the pixels of a mask from its border, mm, as far as `most`; 0 outside."""
    reach, inside, far = int(np.ceil(most / pixel)) + 2, mask.copy(), mask.astype(np.int16)
    for k in range(1, reach):
        inside[k:] &= mask[:-k]
        inside[:-k] &= mask[k:]
        far += inside
    nearest = (square := far**2).copy()
    for k in range(1, reach):
        np.minimum(nearest[:, k:], square[:, :-k] + np.int16(k**2), out=nearest[:, k:])
        np.minimum(nearest[:, :-k], square[:, k:] + np.int16(k**2), out=nearest[:, :-k])
    return np.asarray((np.sqrt(nearest) - 0.5 * mask) * pixel)


def volumes(job: Job, regions: list[Regions], density: float) -> tuple[float, float]:
    """Volume of matrix and fibre over the room for them, in what is solid and in what is sparse."""
    lines, machine = Lines.of(job.done), job.machine
    mine = np.flatnonzero(lines.lays & lines.in_part & ~lines.beside_part)
    laid, room, below = np.zeros(2), np.zeros(2), 0.0
    for region in regions:
        z = lines.end[mine, 2]
        here = mine[(z > below + 1e-6) & (z < region.top + 1e-6)]
        below = region.top
        place, step = sampled(lines.start[here], lines.end[here], 0.1)
        fibre = (lines.tool[here] == 1) * machine.filament_area * lines.length[here]
        matrix = FILAMENT * np.where(lines.tool == 1, lines.beside, lines.fed)[here]
        share = ((matrix + fibre) / np.bincount(step))[step]
        sparse = region.sparse[region.pixels(place[:, :2])]
        laid += share[~sparse].sum(), share[sparse].sum()
        room += np.array(region.areas) * region.height * (1.0, density)
    return float(laid[0] / room[0]), float(laid[1] / max(room[1], 1e-12))


def bridges(job: Job, regions: list[Regions]) -> tuple[float, float, float]:
    """Longest run of a line of infill, and of others, over nothing, mm; share of all such matrix.

    A line is held where its middle lies over a line of the layer of matrix below.
    """
    lines, longest = Lines.of(job.done), [0.0, 0.0]
    width, height = job.machine.matrix_width, lines.end[:, 2].round(3)
    free, total = 0.0, 0.0
    below: np.ndarray | None = None
    for region in regions:
        mine = np.flatnonzero(lines.lays & (lines.tool == 0) & (height == region.top))
        mine = mine[lines.in_part[mine]]
        place, step = sampled(lines.start[mine], lines.end[mine], 0.5 * region.pixel)
        at = region.pixels(place[:, :2])
        if below is not None:
            held = below[at]
            way = (lines.length[mine] / np.bincount(step))[step]
            free, total = free + way[~held].sum(), total + way.sum()
            # Runs go on over steps that join end to end without a corner.
            gap = np.abs(lines.start[mine][1:] - lines.end[mine][:-1]).max(axis=1)
            ahead = (lines.end[mine] - lines.start[mine]) / lines.length[mine, None]
            corner = np.einsum("ij,ij->i", ahead[1:], ahead[:-1]) < _STRAIGHT_ON
            part = np.append(0, np.cumsum((gap > 1e-6) | corner))[step]
            for run in _runs(held, part):
                kind = int(region.sparse[at[0][run], at[1][run]].mean() <= 0.5)
                longest[kind] = max(longest[kind], float(way[run].sum()))
        laid = np.zeros(region.inside.shape, dtype=bool)
        laid[at] = True
        below = _deep(~laid, region.pixel, width) <= 0.5 * width
    return longest[0], longest[1], free / max(total, 1e-12)


def _runs(held: np.ndarray, part: np.ndarray) -> Iterator[slice]:
    """Find runs of places that nothing holds, none over a gap between lines."""
    edges = np.flatnonzero((np.diff(held.astype(int)) != 0) | (np.diff(part) != 0)) + 1
    for first, last in zip([0, *edges], [*edges, len(held)], strict=True):
        if not held[first]:
            yield slice(first, last)


def beyond(job: Job, regions: list[Regions]) -> float:
    """How far the edge of a line of matrix reaches beyond the border of the part, mm."""
    lines, most = Lines.of(job.done), -np.inf
    height = lines.end[:, 2].round(3)
    lower = 0.0
    for region in regions:
        mine = lines.lays & lines.in_part & (lines.tool == 0) & (height == region.top)
        border = job.section(region.top - 0.5 * (region.top - lower))
        lower = region.top
        ends = shapely.points(lines.end[mine][:, :2])
        off = shapely.distance(ends, border.boundary)
        inside = shapely.contains(border, ends)
        edge = 0.5 * np.minimum(lines.width[mine], job.machine.matrix_width)
        most = max(most, float((np.where(inside, -off, off) + edge).max()))
    return most


def seconds(run: Run, most: float, deviation: float) -> float:
    """Time of all moves of a run, s: square of the speed at their ends, forth and back.

    Between corners the nozzle speeds up and slows down by the acceleration; through a corner it
    goes on the arc that leaves it by the deviation. It stands where only filament is fed, at cuts
    and at waits.
    """
    lines = Lines.of(run)
    moves = lines.length > 0.0
    feeds = ~moves
    feeds[:2] = moves[:2] = False
    speed, cuts = np.maximum(lines.speed, 1e-9), np.zeros(len(moves), dtype=bool)
    cuts[[k for k in run.cuts if k < len(cuts)]] = True
    total = run.waited + float((np.abs(lines.fed) / speed)[feeds].sum())
    number = np.cumsum(feeds | cuts)  # a chain of moves between places where the nozzle stands
    rows = np.flatnonzero(moves)
    way = (lines.end - lines.start)[rows] / lines.length[rows, None]
    half = 0.5 * np.arccos(np.clip(np.einsum("ij,ij->i", way[1:], way[:-1]), -1.0, 1.0))
    radius = deviation / np.maximum(1.0 / np.maximum(np.cos(half), 1e-9) - 1.0, 1e-12)
    corner = np.minimum(np.minimum(speed[rows][1:], speed[rows][:-1]) ** 2, most * radius)
    corner[number[rows][1:] != number[rows][:-1]] = 0.0
    square = np.concatenate([[0.0], corner, [0.0]]).tolist()
    gain = (2.0 * most * lines.length[rows]).tolist()
    for k in range(len(gain)):
        square[k + 1] = min(square[k + 1], square[k] + gain[k])
    for k in range(len(gain) - 1, -1, -1):
        square[k] = min(square[k], square[k + 1] + gain[k])
    ends = np.sqrt(square)
    # Up to the top speed, along at it, and down again; or up and down where it is not reached.
    free = np.sqrt(0.5 * (ends[:-1] ** 2 + ends[1:] ** 2 + np.array(gain)))
    peak = np.minimum(speed[rows], free)
    ramp = (2.0 * peak**2 - ends[:-1] ** 2 - ends[1:] ** 2) / (2.0 * most)
    taken = (2.0 * peak - ends[:-1] - ends[1:]) / most
    return total + float((taken + np.maximum(lines.length[rows] - ramp, 0.0) / peak).sum())


@dataclass(frozen=True)
class Row:
    """What a printer makes of a file.

    Attributes
    ----------
    solid, sparse : float, %
        Volume of matrix and fibre over the room for it, in what is solid and in what is sparse.
    bridge, skin : float, mm
        Longest way of a line over nothing, of infill and of skins on it.
    free : float, %
        Share of the matrix that lies on nothing, bridges included.
    air : float, %
        Share of the matrix of walls and skins that neither lies on anything nor bridges infill.
    cut : float, mm
        Length of borders of layers without a wall along them, and of walls where fibre lies.
    beyond : float, mm
        How far the edge of a line reaches beyond the border.
    clock : float, %
        Time in the file over that of the moves in it.
    support : float, cm^3
        Plastic of columns of support.
    strands : int
        Strands of the fibre.
    minutes, grams, megabytes : float
        Time, mass of matrix, and size of the file.
    """

    part: str
    machine: str
    solid: float
    sparse: float
    bridge: float
    skin: float
    free: float
    air: float
    cut: float
    beyond: float
    clock: float
    support: float
    strands: int
    minutes: float
    grams: float
    megabytes: float

    @property
    def words(self) -> list[str]:
        """Its values as they are shown."""
        return [f"{x:.5g}" if isinstance(x, float) else str(x) for x in asdict(self).values()]


def row_of(job: Job, part: str, regions: list[Regions], plastic: Plastic) -> Row:
    """Measure a file."""
    solid, sparse = volumes(job, regions, plastic.density)
    infill, skin, free = bridges(job, regions)
    head, lines = job.done.head, Lines.of(job.done)
    waits = head["of it waiting for tools to heat, first heating left out"].split()[0]
    process, whole = job.machine.process, float(head["TIME"])
    moving = seconds(job.done, process.acceleration, process.junction)
    props = lines.lays & (lines.kind == "Support material")
    return Row(
        part,
        job.name,
        100.0 * solid,
        100.0 * sparse,
        infill,
        skin,
        100.0 * free,
        100.0 * in_air(job.machine, job.done, lambda z, at: _over_infill(regions, z, at)),
        cut_walls(job, regions),
        beyond(job, regions),
        100.0 * (whole - float(waits)) / moving,
        1e-3 * FILAMENT * float(lines.fed[props].sum()),
        len(strands_of(job.done)),
        whole / 60.0,
        float(head["filament used [g]"].split(",")[0]),
        1e-6 * len(job.text.encode()),
    )


def _over_infill(regions: list[Regions], z: float, places: np.ndarray) -> np.ndarray:
    """Whether places (k, 3) of lines with this top lie over infill, which they bridge."""
    below = [region for region in regions if region.top < z - 1e-6]
    return below[-1].sparse[below[-1].pixels(places[:, :2])] if below else places[:, 0] > np.inf


def cut_walls(job: Job, regions: list[Regions]) -> float:
    """Length of borders of layers of matrix without a wall along them, and of walls in fibre, mm.

    Where a section is narrower than a line there is no wall; a wall is in fibre where its top lies
    between top and bottom of a strand that crosses it. Sections are those of the mesh, whose sides
    are chords of the round walls that are printed: a border may be off by as much, also in height.
    """
    lines, width = Lines.of(job.done), job.machine.matrix_width
    height, laid = lines.end[:, 2].round(3), lines.lays & lines.in_part & ~lines.beside_part
    strokes = shapely.linestrings(np.stack([lines.start, lines.end], axis=1)[:, :, :2])
    walls, strands = laid & (lines.kind == PART[0]), laid & (lines.tool == 1)
    missing, lower, reach = 0.0, 0.0, width + job.chords
    for region in regions:
        middle = 0.5 * (lower + region.top)
        section, lower = job.section(middle), region.top
        near = [job.section(middle + step) for step in (-job.chords, job.chords)]
        near = [section if other.is_empty else other for other in near]
        sloping = shapely.symmetric_difference(*near)
        unsure = sloping.buffer(-0.01).buffer(0.01 + job.chords)
        wide = shapely.buffer(shapely.buffer(section, -0.5 * width), 0.5 * width)
        border = shapely.intersection(section.boundary, wide.buffer(0.01)) - unsure
        border = shapely.segmentize(border, 0.5)
        mine = shapely.STRtree(strokes[walls & (height == region.top)])
        pieces = _steps(border)
        walled = mine.query(shapely.centroid(pieces), predicate="dwithin", distance=reach)[0]
        missing += float(shapely.length(np.delete(pieces, np.unique(walled))).sum())
    for z in np.unique(height[strands]).tolist():
        inside = (height > z - job.machine.strand_height + 1e-3) & (height <= z)
        mine = strokes[walls & inside]
        fibre = shapely.union_all(strokes[strands & (height == z)])
        missing += float(shapely.length(mine[shapely.intersects(mine, fibre)]).sum())
    return missing


def _steps(lines: shapely.Geometry) -> np.ndarray:
    """All straight steps of lines."""
    points, line = shapely.get_coordinates(shapely.get_parts(lines), return_index=True)
    steps = np.stack([points[:-1], points[1:]], axis=1)[line[1:] == line[:-1]]
    return np.asarray(shapely.linestrings(steps))


def off(job: Job, row: Row, regions: list[Regions]) -> list[str]:
    """Find what is wrong with a file, a line a check."""
    checks = [check for check in CHECKS if check.__name__ not in ("volume", "air")]
    found = {check.__name__: check(job, job.done) for check in checks}
    limits = {"solid": (row.solid - 100.0, 1.0), "clock": (row.clock - 100.0, 3.0)}
    limits |= {"air": (row.air, 0.5), "cut": (row.cut, 0.0)}
    # With layers of fibre close to each other a part stays solid.
    if any(one.areas[1] for one in regions):
        limits["sparse"] = (row.sparse - 100.0, 1.0)
    found |= {k: [f"off by {x:.3g}"] for k, (x, most) in limits.items() if abs(x) > most}
    return [f"{row.part}, {row.machine}, {k}: {v[0]} ({len(v)})" for k, v in found.items() if v]


def main() -> int:
    """Print the table; the number of findings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="?", default=",".join(PARTS))
    parser.add_argument("machines", nargs="?", default=",".join(machine_names()))
    parser.add_argument("--turned", action="store_true")
    parser.add_argument("--infill", default="gyroid")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    plastic = Plastic(given.infill, 0.2, 2, 3)
    titles = [*Row.__dataclass_fields__, "off"]
    print(f"| {' | '.join(titles)} |\n{len(titles) * '|---'}|")
    said: list[str] = []
    table: list[list[str]] = []
    for name in given.parts.split(","):
        part = part_of(name, plastic)
        for machine in given.machines.split(","):
            job, _ = job_of(part, machine, TURNED if given.turned else AS_IT_STANDS)
            regions = regions_of(job, plastic)
            row = row_of(job, name, regions, plastic)
            wrong = off(job, row, regions)
            said += wrong
            table.append([*row.words, str(len(wrong))])
            print(f"| {' | '.join(table[-1])} |", flush=True)
            if given.out is not None:
                _draw(job, regions, given.out / f"{name}_{machine}.png")
                _write([titles, *table], said, given.out)
    print("\n".join(["", *said]))
    return len(said)


def _write(table: list[list[str]], said: list[str], folder: Path) -> None:
    """Write the table for programs and for people."""
    with (folder / "infill.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(table)
    table = [table[0], len(table[0]) * ["---"], *table[1:]]
    lines = [f"| {' | '.join(words)} |" for words in table] + ["", *(f"- {one}" for one in said)]
    (folder / "infill.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _draw(job: Job, regions: list[Regions], file: Path) -> None:
    """Draw layers of matrix from the bottom to the top, the sparse region in grey."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    file.parent.mkdir(parents=True, exist_ok=True)
    lines, figure = Lines.of(job.done), Figure(figsize=(24, 12), layout="constrained")
    height = lines.end[:, 2].round(3)
    sparse = [k for k, region in enumerate(regions) if region.sparse.any()] or [0]
    chosen = [0, *sparse[:: max(len(sparse) // 6, 1)][:6], len(regions) - 1]
    for axis, k in zip(figure.subplots(2, 4).flat, chosen, strict=False):
        region = regions[k]
        size = region.low + region.pixel * np.array(region.sparse.shape)
        extent = (region.low[0], size[0], region.low[1], size[1])
        shade = 0.15 * region.inside + 0.25 * region.sparse
        axis.imshow(shade.T, origin="lower", extent=extent, cmap="Greys", vmin=0.0, vmax=1.0)
        mine = lines.lays & lines.in_part & (height == region.top) & (lines.tool == 0)
        strokes = np.stack([lines.start[mine], lines.end[mine]], axis=1)[:, :, :2]
        colours = np.where(lines.kind[mine] == PART[0], "#3b6ea5", "#c05020")
        axis.add_collection(LineCollection(list(strokes), colors=colours.tolist(), linewidths=1.5))
        axis.set_title(f"{region.top:g} mm")
        axis.set_aspect("equal")
    figure.savefig(file, dpi=60)


if __name__ == "__main__":
    raise SystemExit(min(main(), 1))
