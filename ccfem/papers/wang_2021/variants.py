"""What was tried where a number of the paper depends on what it does not state.

The radius of the turns, and the hole of the bridge.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ccfem.cases.bridge import bridge_plate
from ccfem.cases.designed import Hole, designed_case
from ccfem.judging.evaluation.indices.curvature import sample_curvature
from ccfem.judging.evaluation.indices.manufacture import sample_manufacture
from ccfem.judging.evaluation.plane_paths import PlanePaths, plane_paths
from ccfem.papers.wang_2021.study import (
    BASELINES,
    LIMIT,
    PATTERNS,
    PartStudy,
    PlateStudy,
    curvature_along,
    run_part,
)
from ccfem.paths.planning import plan
from ccfem.strategies import create

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
    found = {}
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
            found[name, radius] = Tried(
                100.0 * float((sample_curvature(whole, machine.fibre_width).native < LIMIT).mean()),
                100.0 * float((curvature_along(whole)[1] < LIMIT).mean()),
                float(paths.lengths.sum()),
                float(sample_manufacture(paths, made, machine).seconds[0]),
            )
    return found


def try_hole() -> PartStudy:
    """Lay the slicer's patterns on the full bridge with a hole in its middle."""
    plate = replace(bridge_plate(), holes=(_HOLE,))
    return run_part(designed_case(plate, optimised=False), BASELINES, tested=False)


def variant_quantities(
    tried: Mapping[tuple[str, float], Tried], pierced: PartStudy
) -> dict[str, float]:
    """Shares of the vertices below 0.26 / mm, %, by radius and plate; the bridge with a hole."""
    rate = {name: one.rate(30.0) for name, one in pierced.patterns.items()}
    lead = rate["zigzag 45"] - max(rate["concentric"], rate["zigzag 90"])
    return {
        "variant zigzag 45 over the other two at 30 degrees bridge with a hole": lead,
        **{
            f"variant share of vertices below 0.26 with turns of {radius:g} mm {name}": one.vertices
            for (name, radius), one in tried.items()
        },
    }


def variant_table(tried: Mapping[tuple[str, float], Tried]) -> str:
    """Markdown table of all radii."""
    lines = [
        "| plate | tightest turn, mm | vertices below 0.26 / mm, % | length below, % | "
        "length, mm | time, s |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {name} | {radius:g} | {one.vertices:.1f} | {one.length_share:.1f} | {one.length:.0f} | "
        f"{one.seconds:.0f} |"
        for (name, radius), one in tried.items()
    ]
    return "\n".join(lines) + "\n"
