"""What layers and strands on the T-bracket have to reach, in one table beside the authors' own."""

from collections.abc import Mapping
from typing import NamedTuple

from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.papers.fang_2024.measures import Strands
from ccfem.slicing.slicers.spatial import SpatialSlicing
from ccfem.strategies.winding_curves.piece import pieces_with_joints


class _Target(NamedTuple):
    """A figure, the range that it has to lie in, and a better one to aim at."""

    figure: str
    low: float
    high: float
    aim: float | None = None


_INF = float("inf")
_FIELD = (
    _Target("stress to layer, degrees, by volume", 0.0, 9.0),
    _Target("thickness, 5 %, mm", 0.42, _INF),
    _Target("thickness, 50 %, mm", 0.42, 0.62),
    _Target("thickness, 95 %, mm", 0.0, 0.62),
    _Target("layers with all joints in one piece that carry no fibre", 0.0, 0.0),
)
_STRANDS = (
    _Target("per_layer", 3.5, 5.0),
    _Target("closed", 0.97, 1.0),
    _Target("round_all", 1.0, 1.0),
    _Target("angle", 0.0, 17.0, 15.0),
    _Target("angle_weighted", 0.0, 13.5, 12.0),
    _Target("spacing_10", 1.4, _INF, 1.6),
    _Target("spacing_50", 0.0, 2.4, 2.3),
    _Target("spacing_90", 0.0, 3.4, 3.0),
    _Target("curvature_95", 0.0, 0.14),
)
_SECONDS = (
    _Target("all, clock", 0.0, 15.0),
    _Target("slowest layer, processors", 0.0, 0.4),
)
_FINER = _Target("all, clock", 0.0, 40.0)


def field_figures(sliced: SpatialSlicing, stress: PartStress, laid: set[int]) -> dict[str, float]:
    """Figures of the layers by the names of their targets.

    Parameters
    ----------
    sliced : SpatialSlicing
    stress : PartStress
    laid : set of int
        Layers with fibre.
    """
    names, quality = stress.held_or_loaded, sliced.quality
    whole = {
        layer.index
        for layer in sliced.layers
        if max((len(one.loops) for one in pieces_with_joints(layer, names)), default=0) == 3
    }
    figures = (
        quality.angle_mean,
        quality.thickness_5,
        quality.thickness_50,
        quality.thickness_95,
        float(len(whole - laid)),
    )
    return {target.figure: value for target, value in zip(_FIELD, figures, strict=True)}


def targets_table(
    field: Mapping[str, float],
    strands: Mapping[str, Strands],
    seconds: Mapping[str, float],
    finer: Mapping[str, float],
) -> str:
    """Markdown table: figure, ours, ours with ``even``, the authors', what is wanted, verdict."""
    ours, even, theirs = (strands[name].table() for name in ("winding", "winding, even", "authors"))
    head = "| figure | winding | winding, even | authors, same stress | wanted | aim | verdict |"
    lines = [head, "|---" * 7 + "|"]
    lines += [_row(target, field[target.figure]) for target in _FIELD]
    for target in _STRANDS:
        name = target.figure
        lines.append(_row(target, ours[name], f"{even[name]:.3g}", f"{theirs[name]:.3g}"))
    lines += [
        _row(target, seconds[target.figure], name=f"seconds: {target.figure}")
        for target in _SECONDS
    ]
    lines.append(_row(_FINER, finer[_FINER.figure], name="seconds, 170 thousand cells: all, clock"))
    return "\n".join(lines)


def _row(target: _Target, ours: float, even: str = "", theirs: str = "", name: str = "") -> str:
    met = target.low <= ours <= target.high
    if target.high == _INF:
        wanted = f"at least {target.low:g}"
    elif target.low in (0.0, target.high):
        wanted = f"at most {target.high:g}" if target.low != target.high else f"{target.high:g}"
    else:
        wanted = f"{target.low:g} to {target.high:g}"
    verdict, aim = "met" if met else "not met", ""
    if target.aim is not None:
        aim = f"{target.aim:g}"
        reached = ours >= target.aim if target.high == _INF else ours <= target.aim
        verdict += ", aim reached" if reached else ", aim missed"
    shown = name or target.figure
    return f"| {shown} | {ours:.4g} | {even} | {theirs} | {wanted} | {aim} | {verdict} |"
