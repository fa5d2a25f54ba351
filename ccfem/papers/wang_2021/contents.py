"""What of Wang et al. 2021 can be made again."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np
import shapely

from ccfem.base.csv_table import write_csv
from ccfem.base.progress import Progress, silent
from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.cases.designed import PLATES, Hole, designed_case
from ccfem.geometry.medial_axis import medial_axis
from ccfem.judging.evaluation.indices.curvature import sample_curvature
from ccfem.judging.evaluation.indices.manufacture import sample_manufacture
from ccfem.judging.evaluation.indices.matching import READINGS, THRESHOLDS, matching_rate
from ccfem.judging.evaluation.layer_paths import PlanePaths, plane_paths
from ccfem.machine import SpeedTable
from ccfem.papers.contents import Contents, claim_table, judged, table, write_figures, write_report
from ccfem.papers.wang_2021.figures import figures
from ccfem.papers.wang_2021.study import (
    BASELINES,
    LIMIT,
    PATTERNS,
    PartStudy,
    PatternStudy,
    PlateStudy,
    curvature_along,
    run_part,
    run_study,
)
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import LayerStress
from ccfem.strategies import create
from ccfem.strategies.stress_tracing.frame import frame

EXPECTED = Path(__file__).with_name("expected.toml")
"""Claims of the paper, with the ranges that count as reproduced."""

# The whole of the paper: its study, figures, tables and claims beside ours.


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    begun = perf_counter()
    study = run_study(progress=progress)
    tried = try_radii(study)
    values = quantities(study) | variant_quantities(tried, try_hole())
    claims = claim_table(judged(values, EXPECTED))
    computed = perf_counter() - begun
    drawn = write_figures(figures(study), folder)
    rates = [
        [name, which, pattern, reading, *(f"{v:.6g}" for v in paths.rates[reading])]
        for name, plate in study.items()
        for which, part in (("optimised", plate.optimised), ("full", plate.original))
        for pattern, paths in part.patterns.items()
        for reading in READINGS
    ]
    columns = ["plate", "part", "pattern", "reading", *(f"{t:g}" for t in THRESHOLDS)]
    write_csv(folder / "rates.csv", columns, rates)
    write_csv(folder / "quantities.csv", ("quantity", "value"), values.items())
    introduction = (
        "# Load-dependent paths of Wang et al. (2021): ours beside theirs\n\n"
        "Written by `ccfem reproduce wang_2021`. lpp is strategy `svt`; lpp uncrossed "
        "ends its strands in the middle of a joint. The slicer's patterns and lpp uncrossed are "
        "laid by this project too.\n\n"
        "The cantilever, the M-shape and the L-shape are optimised here under loads as in the "
        "paper, which gives no measures: their outlines are ours. The M-shape hangs its load "
        "between its feet, so that members are in tension and in compression, as the paper's are. "
        "`eqs` is our reading of a method that the paper shows in pictures alone.\n\n"
        f"Study {computed:.1f} s, figures {perf_counter() - begun - computed:.1f} s.\n"
    )
    sections = {
        "Claims": claims,
        "Plates": plate_table(study),
        **{name: result_table(plate) for name, plate in study.items()},
        "Radius of the turns": variant_table(tried),
        "Table 2: speeds": speed_table(),
    }
    write_report(folder, introduction, sections, drawn)
    print(claims)
    print(f"report.md: {perf_counter() - begun:.1f} s")


# What was tried where a number of the paper depends on what it does not state.
#
# The radius of the turns, and the hole of the bridge.


RADII = (0.45, 0.8, 1.5, 2.5, 3.85)
"""Tightest turns, mm: half a strand, ours, and the paper's limit of 0.26 / mm among them."""
_PLATES = ("bridge", "suspension")
_HOLE = Hole(92.5, 25.0, 8.0)


@dataclass(frozen=True)
class Tried:
    """What lpp gives with one radius: shares below 0.26 / mm, %, length, mm, and time, s."""

    vertices: float
    length_share: float
    length: float
    seconds: float


def try_radii(study: Mapping[str, PlateStudy]) -> dict[tuple[str, float], Tried]:
    """Plan lpp with every radius, by plate and radius."""
    tried = {}
    for name in _PLATES:
        if name not in study or "lpp" not in study[name].optimised.patterns:
            continue
        part = study[name].optimised
        for radius in RADII:
            machine = replace(part.machine, minimum_radius=radius)
            strategy, parameters = PATTERNS["lpp"]
            made = plan(create(strategy, parameters), (part.layer,), part.field, machine)
            paths = plane_paths(made, part.layer)
            whole = PlanePaths(part.layer, paths.points, paths.offsets, paths.closed)
            tried[name, radius] = Tried(
                100.0 * float((sample_curvature(whole, machine.fibre_width).native < LIMIT).mean()),
                100.0 * float((curvature_along(whole)[1] < LIMIT).mean()),
                float(paths.lengths.sum()),
                float(sample_manufacture(paths, made, machine).seconds[0]),
            )
    return tried


def try_hole() -> PartStudy:
    """Lay the slicer's patterns on the full bridge with a hole in its middle."""
    plate = replace(PLATES["bridge"], holes=(_HOLE,))
    return run_part(designed_case(plate, optimised=False), BASELINES, tested=False)


def variant_quantities(
    tried: Mapping[tuple[str, float], Tried], pierced: PartStudy
) -> dict[str, float]:
    """Shares of the vertices below 0.26 / mm, %, by radius and plate; the bridge with a hole."""
    rate = {name: variant.rate(30.0) for name, variant in pierced.patterns.items()}
    lead = rate["zigzag 45"] - max(rate["concentric"], rate["zigzag 90"])
    shares = {
        f"variant share of vertices below 0.26 with turns of {radius:g} mm {name}": lpp.vertices
        for (name, radius), lpp in tried.items()
    }
    return {"variant zigzag 45 over the other two at 30 degrees bridge with a hole": lead, **shares}


def variant_table(tried: Mapping[tuple[str, float], Tried]) -> str:
    """Markdown table of all radii."""
    head = ("plate", "tightest turn, mm", "vertices below 0.26 / mm, %")
    rows = [
        (
            *(name, f"{radius:g}", f"{lpp.vertices:.1f}", f"{lpp.length_share:.1f}"),
            *(f"{lpp.length:.0f}", f"{lpp.seconds:.0f}"),
        )
        for (name, radius), lpp in tried.items()
    ]
    return table((*head, "length below, %", "length, mm", "time, s"), rows)


CONTENTS = Contents(
    title="Wang et al. 2021, load-dependent path planning",
    seconds=120.0,
    run=lambda progress: run_study(progress=progress),
    whole=write_all,
    tables={
        "claims": lambda study: claim_table(judged(quantities(study()), EXPECTED)),
        "table2": lambda study: speed_table(),
        "plates": lambda study: plate_table(study()),
    },
    figures=figures,
    numbers=(3, *range(5, 18)),
)


# Tables of a run, in Markdown.


ROWS = {
    "path 5": "fibre within 5 degrees of the stress, %",
    "path 10": "10 degrees",
    "path 20": "20 degrees",
    "path 30": "30 degrees",
    "path 45": "45 degrees",
    "energy 30": "30 degrees, weighted with the stress, %",
    "stress_best 30": "stress within 30 degrees of the best fibre within 1 mm, %",
    "stress_nearest 30": "stress within 30 degrees of the nearest fibre, %",
    "vertices": "vertices below 0.26 / mm, %",
    "length below": "length below 0.26 / mm, %",
    "largest": "largest curvature, 1/mm",
    "tension": "stiffness x, tension only, equal fibre in the part",
    "bonded": "stiffness x, bonded, equal fibre in the part",
    "pieces": "pieces",
    "length": "length, mm",
    "link_outside": "links outside, mm",
    "link_over_void": "links over windows, mm",
    "link_inside": "links inside, mm",
    "coverage": "covered, %",
    "overfill": "fibre laid over the area",
    "crossings": "crossings",
    "time": "print time, s",
    "speed": "mean speed, mm/s",
    "seconds": "planning, s",
}


def _value(pattern: PatternStudy, row: str) -> float | None:
    """One index of one pattern; None where it was not computed."""
    head, _, angle = row.rpartition(" ")
    if head in pattern.rates:
        return pattern.rate(float(angle), head)
    if row in ("tension", "bonded"):
        return pattern.stiffness.get(row)
    total = pattern.total
    return {
        "vertices": 100.0 * float((pattern.native < LIMIT).mean()),
        "length below": 100.0 * float((pattern.curvature < LIMIT).mean()),
        "largest": float(pattern.curvature.max(initial=0.0)),
        "pieces": total["paths"],
        "length": total["fibre_length"],
        "coverage": 100.0 * total["coverage"],
        "crossings": total["crossings"] + total["self_crossings"],
        "time": total["print_time"],
        "speed": total["mean_speed"],
        "seconds": pattern.seconds,
        **{name: total[name] for name in ("overfill", "link_outside", "link_over_void")},
        "link_inside": total["link_inside"],
    }[row]


def result_table(plate: PlateStudy) -> str:
    """Every index of every pattern, on the optimised part and on the full plate."""
    columns = dict(plate.optimised.patterns)
    columns |= {f"{name}, full plate": pattern for name, pattern in plate.original.patterns.items()}
    rows = []
    for row, text in ROWS.items():
        values = [_value(pattern, row) for pattern in columns.values()]
        rows.append([text, *("" if v is None else f"{v:.4g}" for v in values)])
    return table(["index", *columns], rows)


def plate_table(study: Mapping[str, PlateStudy]) -> str:
    """List the plates and their optimisation."""
    rows = []
    for name, plate_study in study.items():
        plate, design = plate_study.plate, plate_study.design
        width, height = plate.border.bounds[2:]
        of_design = ["", "", "", ""]
        if design is not None:
            of_design = [
                f"{design.compliance[-1]:.4g}",
                str(design.iterations),
                f"{design.grey:.3f}",
                f"{100.0 * plate_study.off_stored:.2f}",
            ]
        work = [
            2.0 * part.field.strain_energy for part in (plate_study.original, plate_study.optimised)
        ]
        rows.append(
            [
                name,
                f"{width:g} x {height:g}",
                f"{plate.volume_fraction:g}",
                f"{plate_study.optimised.layer.plane.polygon.area / plate.domain.area:.3f}",
                *of_design,
                *(f"{w:.1f}" for w in work),
                f"{plate_study.seconds:.1f}",
            ]
        )
    head = [
        "plate",
        "box, mm",
        "volume fraction",
        "of the part",
        "compliance of the design, N mm",
        "iterations",
        "grey",
        "off the stored part, %",
        "compliance of the print without fibre: full plate, N mm",
        "part, N mm",
        "all patterns, s",
    ]
    return table(head, rows)


def speed_table() -> str:
    """Table 2: which speed a piece of the path gets."""
    speeds = SpeedTable()
    slow, middle, fast = (f"{speed:g} mm/s" for speed in speeds.speed)
    (high, low), (short, long), (sharp, flat) = speeds.curvature, speeds.length, speeds.angle
    rows = [
        ["curvature, 1/mm", f"> {high:g}", f"{low:g} to {high:g}", f"< {low:g}"],
        ["length, mm", f"< {short:g}", f"{short:g} to {long:g}", f"> {long:g}"],
        ["angle, degrees", f"< {sharp:g}", f"{sharp:g} to {flat:g}", f">= {flat:g}"],
    ]
    return table(["piece", slow, middle, fast], rows)


# The claims of the paper beside ours: every quantity is computed from a run.

_RANGES = {"5 to 45": (5.0, 45.0), "10 to 30": (10.0, 30.0)}
_NEAR_HOLE = 2.0
"""Radii from the centre of a hole within which a place is near it."""
_SHARP = 45.0
"""Turn, degrees, within a step of half a millimetre that is a sharp one."""


def quantities(study: Mapping[str, PlateStudy]) -> dict[str, float]:
    """Every quantity that `expected.toml` may name; those whose patterns did not run are left out.

    Shares and rates are in percent, leads in points, orders that hold are 1, others 0.
    """
    values: dict[str, float] = dict(_speeds())
    for name, plate in study.items():
        for rule in (_design, _stresses, _curvatures, _rates, _leads, _fill, _tested):
            values |= {f"{key} {name}": value for key, value in rule(plate).items()}
    return values


def _speeds() -> dict[str, float]:
    """Compute how many of the limits of table 2 the speed table has as printed, of nine."""
    at = SpeedTable().at
    fast = (0.01, 30.0, 180.0)
    rows = [
        ((0.2001, *fast[1:]), 7.0),
        ((0.2, *fast[1:]), 15.0),
        ((0.05, *fast[1:]), 15.0),
        ((0.0499, *fast[1:]), 35.0),
        ((fast[0], 14.99, fast[2]), 7.0),
        ((fast[0], 15.0, fast[2]), 15.0),
        ((fast[0], 25.0, fast[2]), 15.0),
        ((*fast[:2], 89.9), 7.0),
        ((*fast[:2], 90.0), 15.0),
        ((*fast[:2], 135.0), 35.0),
    ]
    return {"speeds of table 2 at its limits, of 10": float(sum(at(*x) == v for x, v in rows))}


def _design(plate: PlateStudy) -> dict[str, float]:
    box = plate.plate.border.bounds
    values = {"width": box[2], "height": box[3]}
    if plate.design is not None:
        values["volume fraction of the design"] = plate.design.volume_fraction
        values["part off the stored one, %"] = 100.0 * plate.off_stored
    return values


def uniaxial(stress: LayerStress) -> float:
    """Share of the area, %, where one principal stress is at least five times the other in size."""
    plane = in_plane(stress.nodal, stress.layer.plane.frame)[stress.layer.triangles].mean(axis=1)
    sizes = np.sort(np.abs(np.stack(largest_in_plane(plane)[:2])), axis=0)
    single = sizes[1] >= 5.0 * sizes[0]
    return 100.0 * float(stress.layer.areas[single].sum() / stress.layer.areas.sum())


def _stresses(plate: PlateStudy) -> dict[str, float]:
    part = plate.optimised
    width = part.machine.fibre_width
    axis = medial_axis(part.layer.plane.polygon, 0.5 * width, object_angle=None, arc_chord=1.6)
    lines = Toolpaths.from_plane([segment.points for segment in axis.segments], part.layer)
    rate = matching_rate(lines, [part.stress], "stress_nearest", np.array([30.0]), step=width)
    before, after = uniaxial(plate.original.stress), uniaxial(part.stress)
    return {
        "stress within 30 degrees of the medial axis": 100.0 * float(rate[0]),
        "gain of uniaxial stress": after - before,
    }


def _below(curvature: np.ndarray) -> float:
    return 100.0 * float((curvature < LIMIT).mean())


def _sharp_turns(pattern: PatternStudy) -> float:
    """Sharp turns in the part a metre of fibre."""
    limit = 2.0 * np.sin(np.radians(0.5 * _SHARP)) / 0.5
    metres = 1e-3 * float(pattern.paths.in_part.lengths.sum())
    return float((pattern.curvature_in_part > limit).sum()) / metres


def _curvatures(plate: PlateStudy) -> dict[str, float]:
    values: dict[str, float] = {}
    for where, part in (("", plate.optimised), (" on the full plate", plate.original)):
        for name, pattern in part.patterns.items():
            values[f"largest curvature of {name}{where}"] = float(
                pattern.curvature.max(initial=0.0)
            )
            values[f"sharp turns a metre of {name}{where}"] = _sharp_turns(pattern)
    if "lpp" not in plate.optimised.patterns:
        return values
    lpp = plate.optimised.patterns["lpp"]
    readings = ("native", "native_in_part", "curvature", "curvature_in_part")
    labels = ("vertices", "vertices in the part", "0.5 mm", "0.5 mm in the part")
    for reading, label in zip(readings, labels, strict=True):
        values[f"lpp below 0.26, {label}"] = _below(getattr(lpp, reading))
    for where, part in (("optimised part", plate.optimised), ("full plate", plate.original)):
        others = [part.patterns[p] for p in BASELINES if p in part.patterns]
        if others:
            for reading, label in zip(readings[1::2], labels[1::2], strict=True):
                best = max(_below(getattr(pattern, reading)) for pattern in others)
                share = _below(getattr(lpp, reading))
                values[f"lead below 0.26 on the {where}, {label}"] = share - best
            least = min(_sharp_turns(pattern) for pattern in others)
            fewer = float(_sharp_turns(lpp) < least)
            values[f"lpp has the fewest sharp turns, others on the {where}"] = fewer
    inside = shapely.contains_xy(plate.optimised.layer.plane.polygon.buffer(1e-3), *lpp.places.T)
    sharp = lpp.curvature > LIMIT
    values["tight places of lpp that lie outside"] = 100.0 * float((~inside[sharp]).mean())
    if plate.plate.holes and "concentric" in plate.original.patterns:
        pattern = plate.original.patterns["concentric"]
        near = [
            np.linalg.norm(pattern.places - (hole.x, hole.y), axis=1) < _NEAR_HOLE * hole.radius
            for hole in plate.plate.holes
        ]
        tight = pattern.curvature > LIMIT
        values["tight places of concentric near the holes"] = 100.0 * float(
            np.any(near, axis=0)[tight].mean()
        )
    return values


def _rates(plate: PlateStudy) -> dict[str, float]:
    values: dict[str, float] = {}
    for where, part in (("", plate.optimised), (" on the full plate", plate.original)):
        for name, pattern in part.patterns.items():
            for reading in ("path", "strands", "stress_best", "stress_nearest"):
                values[f"{reading} within 30 degrees of {name}{where}"] = pattern.rate(
                    30.0, reading
                )
    full = plate.original.patterns
    if set(BASELINES) <= set(full):
        rate = {name: full[name].rate(30.0) for name in BASELINES}
        others = (rate["concentric"], rate["zigzag 90"])
        values["zigzag 45 over the other two at 30 degrees"] = rate["zigzag 45"] - max(others)
        values["zigzag 90 is the lowest at 30 degrees"] = float(
            rate["zigzag 90"] < min(rate["concentric"], rate["zigzag 45"])
        )
    return values


def _leads(plate: PlateStudy) -> dict[str, float]:
    """Smallest lead of lpp over the best pattern of the slicer, over ranges of angles."""
    values: dict[str, float] = {}
    for name in ("lpp", "lpp uncrossed"):
        if name not in plate.optimised.patterns:
            continue
        for where, part in (("optimised part", plate.optimised), ("full plate", plate.original)):
            others = [part.patterns[p] for p in BASELINES if p in part.patterns]
            if not others:
                continue
            best = np.max([pattern.rates["path"] for pattern in others], axis=0)
            lead = 100.0 * (plate.optimised.patterns[name].rates["strands"] - best)
            for label, (low, high) in _RANGES.items():
                chosen = (low - 1e-9 <= THRESHOLDS) & (high + 1e-9 >= THRESHOLDS)
                key = f"least lead of {name} from {label} degrees, others on the {where}"
                values[key] = float(lead[chosen].min())
            mean = float(lead[THRESHOLDS <= 60.0 + 1e-9].mean())
            values[f"mean lead of {name} to 60 degrees, others on the {where}"] = mean
    return values


def joint_discs(part: PartStudy) -> object:
    """Discs of the joints of a part, within its section: a shapely geometry."""
    joints = frame(part.layer.plane.polygon, 0.5 * part.machine.fibre_width)
    discs = shapely.buffer(shapely.points(joints.joints), joints.radius)
    return shapely.intersection(shapely.union_all(discs), part.layer.plane.polygon)


def _fill(plate: PlateStudy) -> dict[str, float]:
    part = plate.optimised
    discs = joint_discs(part)
    values: dict[str, float] = {}
    half = 0.5 * part.machine.fibre_width
    for name, pattern in part.patterns.items():
        values[f"coverage of {name}"] = 100.0 * pattern.total["coverage"]
        values[f"pieces of {name}"] = pattern.total["paths"]
        if not shapely.is_empty(discs):
            lines = pattern.paths.in_part
            index = np.repeat(np.arange(len(lines)), np.diff(lines.offsets))
            fibre = shapely.union_all(
                shapely.buffer(shapely.linestrings(lines.points, indices=index), half)
            )
            share = shapely.area(shapely.intersection(fibre, discs)) / shapely.area(discs)
            values[f"coverage of the joints by {name}"] = 100.0 * float(share)
    if "lpp" in part.patterns:
        total = part.patterns["lpp"].total
        values["crossings of lpp"] = total["crossings"] + total["self_crossings"]
        for other in ("offset", "streamline", "eqs"):
            if other in part.patterns:
                less = values["coverage of lpp"] - values[f"coverage of {other}"]
                values[f"coverage of lpp less {other}"] = less
                key = "coverage of the joints by {}"
                if key.format(other) in values:
                    less = values[key.format("lpp")] - values[key.format(other)]
                    values[f"coverage of the joints by lpp less {other}"] = less
    return values


def _tested(plate: PlateStudy) -> dict[str, float]:
    """Stiffness of the part under lpp over that under the others, at equal fibre."""
    patterns = plate.optimised.patterns
    if "lpp" not in patterns:
        return {}
    gained = patterns["lpp"].stiffness
    values = {}
    for other in ("concentric", "zigzag 45", "zigzag 90", "offset", "streamline", "eqs"):
        if other in patterns:
            for mode, value in patterns[other].stiffness.items():
                values[f"stiffness of lpp over {other}, {mode}"] = gained[mode] / value
    return values
