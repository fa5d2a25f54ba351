"""The claims of the paper beside ours: every quantity is computed from a run."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import shapely

from ccfem.base.tensor import in_plane, largest_in_plane
from ccfem.geometry.medial_axis import medial_axis
from ccfem.judging.evaluation.indices.matching import THRESHOLDS, matching_rate
from ccfem.machine import SpeedTable
from ccfem.papers.verdicts import Check, judged
from ccfem.papers.wang_2021.study import BASELINES, LIMIT, PartStudy, PatternStudy, PlateStudy
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import LayerStress
from ccfem.strategies.stress_tracing.frame import frame

EXPECTED = Path(__file__).with_name("expected.toml")

_RANGES = {"5 to 45": (5.0, 45.0), "10 to 30": (10.0, 30.0)}
_NEAR_HOLE = 2.0
"""Radii from the centre of a hole within which a place is near it."""
_SHARP = 45.0
"""Turn, degrees, within a step of half a millimetre that is a sharp one."""


def quantities(study: Mapping[str, PlateStudy]) -> dict[str, float]:
    """Every quantity that `expected.toml` may name; those whose patterns did not run are left out.

    Shares and rates are in percent, leads in points, orders that hold are 1, others 0.
    """
    found: dict[str, float] = dict(_speeds())
    for name, plate in study.items():
        for rule in (_design, _stresses, _curvatures, _rates, _leads, _fill, _tested):
            found |= {f"{key} {name}": value for key, value in rule(plate).items()}
    return found


def verdicts(found: Mapping[str, float]) -> list[Check]:
    """Judge every check of `expected.toml` by the quantities found."""
    return judged(found, EXPECTED)


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
    found = {"width": box[2], "height": box[3]}
    if plate.design is not None:
        found["volume fraction of the design"] = plate.design.volume_fraction
        found["part off the stored one, %"] = 100.0 * plate.off_stored
    return found


def uniaxial(stress: LayerStress) -> float:
    """Share of the area, %, where one principal stress is at least five times the other in size."""
    plane = in_plane(stress.nodal, stress.layer.plane.frame)[stress.layer.triangles].mean(axis=1)
    sizes = np.sort(np.abs(np.stack(largest_in_plane(plane)[:2])), axis=0)
    one = sizes[1] >= 5.0 * sizes[0]
    return 100.0 * float(stress.layer.areas[one].sum() / stress.layer.areas.sum())


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
    found: dict[str, float] = {}
    for where, part in (("", plate.optimised), (" on the full plate", plate.original)):
        for name, one in part.patterns.items():
            found[f"largest curvature of {name}{where}"] = float(one.curvature.max(initial=0.0))
            found[f"sharp turns a metre of {name}{where}"] = _sharp_turns(one)
    if "lpp" not in plate.optimised.patterns:
        return found
    lpp = plate.optimised.patterns["lpp"]
    readings = ("native", "native_in_part", "curvature", "curvature_in_part")
    labels = ("vertices", "vertices in the part", "0.5 mm", "0.5 mm in the part")
    for reading, label in zip(readings, labels, strict=True):
        found[f"lpp below 0.26, {label}"] = _below(getattr(lpp, reading))
    for where, part in (("optimised part", plate.optimised), ("full plate", plate.original)):
        others = [part.patterns[p] for p in BASELINES if p in part.patterns]
        if others:
            for reading, label in zip(readings[1::2], labels[1::2], strict=True):
                best = max(_below(getattr(one, reading)) for one in others)
                own = _below(getattr(lpp, reading))
                found[f"lead below 0.26 on the {where}, {label}"] = own - best
            least = min(_sharp_turns(one) for one in others)
            fewer = float(_sharp_turns(lpp) < least)
            found[f"lpp has the fewest sharp turns, others on the {where}"] = fewer
    inside = shapely.contains_xy(plate.optimised.layer.plane.polygon.buffer(1e-3), *lpp.places.T)
    sharp = lpp.curvature > LIMIT
    found["tight places of lpp that lie outside"] = 100.0 * float((~inside[sharp]).mean())
    if plate.plate.holes and "concentric" in plate.original.patterns:
        one = plate.original.patterns["concentric"]
        near = [
            np.linalg.norm(one.places - (hole.x, hole.y), axis=1) < _NEAR_HOLE * hole.radius
            for hole in plate.plate.holes
        ]
        tight = one.curvature > LIMIT
        found["tight places of concentric near the holes"] = 100.0 * float(
            np.any(near, axis=0)[tight].mean()
        )
    return found


def _rates(plate: PlateStudy) -> dict[str, float]:
    found: dict[str, float] = {}
    for where, part in (("", plate.optimised), (" on the full plate", plate.original)):
        for name, one in part.patterns.items():
            for reading in ("path", "strands", "stress_best", "stress_nearest"):
                found[f"{reading} within 30 degrees of {name}{where}"] = one.rate(30.0, reading)
    full = plate.original.patterns
    if set(BASELINES) <= set(full):
        rate = {name: full[name].rate(30.0) for name in BASELINES}
        others = (rate["concentric"], rate["zigzag 90"])
        found["zigzag 45 over the other two at 30 degrees"] = rate["zigzag 45"] - max(others)
        found["zigzag 90 is the lowest at 30 degrees"] = float(
            rate["zigzag 90"] < min(rate["concentric"], rate["zigzag 45"])
        )
    return found


def _leads(plate: PlateStudy) -> dict[str, float]:
    """Smallest lead of lpp over the best pattern of the slicer, over ranges of angles."""
    found: dict[str, float] = {}
    for own in ("lpp", "lpp uncrossed"):
        if own not in plate.optimised.patterns:
            continue
        for where, part in (("optimised part", plate.optimised), ("full plate", plate.original)):
            others = [part.patterns[p] for p in BASELINES if p in part.patterns]
            if not others:
                continue
            best = np.max([one.rates["path"] for one in others], axis=0)
            lead = 100.0 * (plate.optimised.patterns[own].rates["strands"] - best)
            for label, (low, high) in _RANGES.items():
                chosen = (low - 1e-9 <= THRESHOLDS) & (high + 1e-9 >= THRESHOLDS)
                key = f"least lead of {own} from {label} degrees, others on the {where}"
                found[key] = float(lead[chosen].min())
            mean = float(lead[THRESHOLDS <= 60.0 + 1e-9].mean())
            found[f"mean lead of {own} to 60 degrees, others on the {where}"] = mean
    return found


def joint_discs(part: PartStudy) -> object:
    """Discs of the joints of a part, within its section: a shapely geometry."""
    joints = frame(part.layer.plane.polygon, 0.5 * part.machine.fibre_width)
    discs = shapely.buffer(shapely.points(joints.joints), joints.radius)
    return shapely.intersection(shapely.union_all(discs), part.layer.plane.polygon)


def _fill(plate: PlateStudy) -> dict[str, float]:
    part = plate.optimised
    discs = joint_discs(part)
    found: dict[str, float] = {}
    half = 0.5 * part.machine.fibre_width
    for name, one in part.patterns.items():
        found[f"coverage of {name}"] = 100.0 * one.total["coverage"]
        found[f"pieces of {name}"] = one.total["paths"]
        if not shapely.is_empty(discs):
            lines = one.paths.in_part
            index = np.repeat(np.arange(len(lines)), np.diff(lines.offsets))
            fibre = shapely.union_all(
                shapely.buffer(shapely.linestrings(lines.points, indices=index), half)
            )
            share = shapely.area(shapely.intersection(fibre, discs)) / shapely.area(discs)
            found[f"coverage of the joints by {name}"] = 100.0 * float(share)
    if "lpp" in part.patterns:
        total = part.patterns["lpp"].total
        found["crossings of lpp"] = total["crossings"] + total["self_crossings"]
        for other in ("offset", "streamline", "eqs"):
            if other in part.patterns:
                less = found["coverage of lpp"] - found[f"coverage of {other}"]
                found[f"coverage of lpp less {other}"] = less
                key = "coverage of the joints by {}"
                if key.format(other) in found:
                    less = found[key.format("lpp")] - found[key.format(other)]
                    found[f"coverage of the joints by lpp less {other}"] = less
    return found


def _tested(plate: PlateStudy) -> dict[str, float]:
    """Stiffness of the part under lpp over that under the others, at equal fibre."""
    patterns = plate.optimised.patterns
    if "lpp" not in patterns:
        return {}
    own = patterns["lpp"].stiffness
    found = {}
    for other in ("concentric", "zigzag 45", "zigzag 90", "offset", "streamline", "eqs"):
        if other in patterns:
            for mode, value in patterns[other].stiffness.items():
                found[f"stiffness of lpp over {other}, {mode}"] = own[mode] / value
    return found
