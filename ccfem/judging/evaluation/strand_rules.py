"""Rules that every strand obeys by itself, or the plan cannot be printed: nothing is pooled.

* A strand needs a run of the cutter's length free of folds (`ccfem.paths.folds`): what lies between
  two folds and is shorter is a scribble that no head lays. Patterns that turn so by design keep
  their turns, and are judged by what still carries.
* It holds before it is cut: `Machine.held_length` lies without a fold behind its start, and as much
  before its cut, a tail before its end. The head may begin at either end.
* Of the area of a strand, its length times a fibre width, no more than a twentieth lies outside the
  part. Links do not count where they are wholly outside: those are laid on pads and cut off.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief
from ccfem.base.parallel import in_processes
from ccfem.geometry.polylines import point_at
from ccfem.judging.virtual_testing.strand_room import StrandParts, joined_parts, strand_parts
from ccfem.machine.machine import Machine
from ccfem.paths.folds import WINDOW, Folds, joined_folds
from ccfem.paths.repeated import repeated_layers
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer, flat_layers

OUTSIDE = 0.05
"""Share of a strand's area that may lie outside the part. Our choice: the corners of a strand that
ends square at an oblique wall, and no more."""
_ROUNDING = 1e-6
"""Share of the cutter's length that a run may miss by rounding."""


@dataclass(frozen=True)
class BrokenRule:
    """A rule, and the strands that break it."""

    rule: str  # {"folds", "held", "outside"}
    strands: IntArray  # (k,): numbers of the fibre paths, the worst first
    # (k, 3), mm: where each breaks it: at its middle fold, at the fold near its start or cut, and
    # where most of its width is outside
    places: FloatArray
    words: str  # one line: how many, by how much, and where the worst is

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, strands=int, places=float)


@dataclass(frozen=True)
class StrandVerdict:
    """What the rules say of all strands."""

    broken: tuple[BrokenRule, ...] = ()
    remark: str = ""  # what folds that are no reason to refuse the plan cost; empty without any
    parts: StrandParts | None = None  # of the strands, as the virtual test takes them too

    __repr__ = in_brief

    def strands(self, count: int) -> BoolArray:
        """Mask (count,) of the fibre paths that break a rule."""
        mask = np.zeros(count, dtype=bool)
        for rule in self.broken:
            mask[rule.strands] = True
        return mask


def strand_verdict(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    machine: Machine,
    folds_by_design: bool = False,
    with_parts: bool = True,
) -> StrandVerdict:
    """Hold every strand against the rules.

    Parameters
    ----------
    layers : sequence of Layer
        That the strands lie on.
    folds_by_design : bool, default False
        Whether the strategy's published pattern turns more tightly than the machine's radius: its
        folds carry nothing, but are no reason to refuse the plan.
    with_parts : bool, default True
        Whether the verdict keeps the parts of the strands: some 100 bytes for each quarter of a
        fibre width.
    """
    fibre = toolpaths.of_kind(FIBRE)
    strands = _looked_at(fibre, layers, machine, with_parts)
    folds = strands.folds
    folded = () if folds_by_design else _folded(fibre, folds, machine)
    held = () if folds_by_design else _not_held(fibre, folds, machine)
    count, places = int((folds.counts > 0).sum()), len(folds.line)
    remark = ""
    if count:
        design = ", as its pattern is published," if folds_by_design else ""
        remark = (
            f"{count} of {len(fibre)} strands turn back on themselves in {places} places{design} "
            f"by more than 90 degrees within {WINDOW * machine.minimum_radius:.3g} mm: "
            f"{folds.folded.sum():.0f} mm of fibre in these folds carry nothing"
        )
    return StrandVerdict((*folded, *held, *_outside(strands)), remark, strands.parts)


class _Strands(NamedTuple):
    """What the rules look at.

    `folds` of the strands; the share of the width of each that lies `outside` the part, (n,), and
    the `place` where most does, (n, 3), mm; and their `parts`, if kept.
    """

    folds: Folds
    outside: FloatArray
    place: FloatArray
    parts: StrandParts | None


def _looked_at(
    fibre: Toolpaths, layers: Sequence[Layer], machine: Machine, with_parts: bool
) -> _Strands:
    """Look at all strands: layer by layer where strands of one cannot touch those of another."""

    def one(some: Toolpaths, on: Sequence[Layer]) -> _Strands:
        parts = strand_parts(some, machine, on, shared=with_parts)
        line, length, first = parts.beads.line, parts.beads.length, parts.beads.first
        # A link is cut off where it is outside, not where it lies along the border.
        away = np.where(parts.link & (parts.inside <= 0.0), 0.0, 1.0 - parts.inside)
        area = np.bincount(line, length, len(some))
        share = np.bincount(line, length * away, len(some)) / np.maximum(area, 1e-300)
        place = np.zeros((len(some), 3))
        for k in np.flatnonzero(share > OUTSIDE).tolist():
            most = first[k] + int(away[first[k] : first[k + 1]].argmax())
            place[k] = parts.beads.middle[most]
        return _Strands(parts.folds, share, place, parts if with_parts else None)

    flat = sorted(layer.plane.height for layer in flat_layers(layers))
    near = np.diff(flat).min(initial=np.inf) < machine.strand_height * (1.0 - _ROUNDING)
    if len(flat) < max(len(layers), 2) or near or (np.diff(fibre.layer) < 0).any():
        return one(fibre, layers)
    with_fibre = [layer for layer in layers if layer.index in fibre.layer]
    with_fibre.sort(key=lambda layer: layer.index)
    if not with_fibre:
        return one(fibre, layers)
    # Layers that repeat others are looked at once, where nothing is kept of the strands themselves.
    source = np.arange(len(with_fibre)) if with_parts else repeated_layers(fibre, with_fibre)
    first = np.unique(source).tolist()
    fibres = [fibre.on_layer(with_fibre[k].index) for k in first]
    results = in_processes(one, fibres, [[with_fibre[k]] for k in first], shared=[fibre])
    known = dict(zip(first, results, strict=True))
    looked = [
        _at_height(known[at], with_fibre[at], with_fibre[k]) for k, at in enumerate(source.tolist())
    ]
    kept = [strands.parts for strands in looked if strands.parts is not None]
    return _Strands(
        joined_folds([strands.folds for strands in looked]),
        np.concatenate([strands.outside for strands in looked]),
        np.concatenate([strands.place for strands in looked]),
        joined_parts(kept) if with_parts else None,
    )


def _at_height(strands: _Strands, layer: Layer, other: Layer) -> _Strands:
    """Return what was found on a flat layer for another one that repeats it."""
    rise = (other.plane.height - layer.plane.height) * layer.plane.frame[2]
    return strands._replace(
        place=strands.place + rise * (strands.place != 0.0).any(axis=1)[:, None]
    )


def _folded(fibre: Toolpaths, folds: Folds, machine: Machine) -> tuple[BrokenRule, ...]:
    """Strands without a run of the cutter's length free of folds."""
    least = machine.shortest_strand
    free = folds.longest_free
    short = np.flatnonzero((folds.counts > 0) & (free < least * (1.0 - _ROUNDING)))
    if not len(short):
        return ()
    order = short[np.argsort(free[short], kind="stable")]
    lines = list(fibre)
    places = []
    for k in order.tolist():
        at = np.sort(folds.places[folds.line == k])
        places.append(point_at(lines[k], float(at[len(at) // 2])))
    return (
        _broken(
            "folds",
            order,
            np.array(places),
            f"{len(order)} of {len(fibre)} strands have no {least:g} mm free of turns by more than "
            f"90 degrees within {WINDOW * machine.minimum_radius:.3g} mm; the worst has "
            f"{free[order[0]]:.3g} mm",
        ),
    )


def _not_held(fibre: Toolpaths, folds: Folds, machine: Machine) -> tuple[BrokenRule, ...]:
    """Strands that fold before they hold, behind their start or before their cut."""
    held, tail = machine.held_length, machine.tail
    size = folds.lengths[folds.line]
    near = np.zeros(len(size), dtype=bool)
    # Printed forwards, and backwards: the order of printing decides.
    for start, stop in ((folds.start, folds.stop), (size - folds.stop, size - folds.start)):
        near |= (start < held) | ((stop > size - tail - held) & (start < size - tail))
    if not held or not near.any():
        return ()
    # The fold nearest to an end is the worst.
    off = np.minimum(folds.start, size - folds.stop)
    order = np.flatnonzero(near)[np.argsort(off[near], kind="stable")]
    _, first = np.unique(folds.line[order], return_index=True)
    worst = order[np.sort(first)]
    strands, lines = folds.line[worst], list(fibre)
    at = zip(strands.tolist(), folds.places[worst].tolist(), strict=True)
    return (
        _broken(
            "held",
            strands,
            np.array([point_at(lines[k], place) for k, place in at]),
            f"{len(strands)} of {len(fibre)} strands turn back within the {held:g} mm behind their "
            "start or before their cut that are to hold them; the worst",
        ),
    )


def _outside(strands: _Strands) -> tuple[BrokenRule, ...]:
    """Strands of which too much lies outside the part."""
    share = strands.outside
    wide = np.flatnonzero(share > OUTSIDE)
    if not len(wide):
        return ()
    order = wide[np.argsort(-share[wide], kind="stable")]
    return (
        _broken(
            "outside",
            order,
            strands.place[order],
            f"{len(order)} of {len(share)} strands lie outside the part by more than "
            f"{OUTSIDE:.0%} of their width; the worst by {share[order[0]]:.0%}",
        ),
    )


def _broken(rule: str, strands: IntArray, places: FloatArray, words: str) -> BrokenRule:
    """Broken rule whose words name the place of the worst strand."""
    at = ", ".join(f"{x:.1f}" for x in places[0])
    return BrokenRule(rule, strands, places, f"{words}, at ({at}) mm")


# Whether paths can be printed as they are, and what breaks it where they cannot.


@dataclass(frozen=True)
class _Rule:
    """One thing that breaks a print: an index, the field of `Limits` that bounds it, and words."""

    limit: str
    words: str
    pattern: str = "{:.0%}"


_RULES = (
    _Rule(
        "short", "{found} of the fibre lies in paths shorter than {machine.shortest_strand:g} mm"
    ),
    _Rule("tight", "{found} of the fibre turns tighter than {machine.minimum_radius:g} mm"),
    _Rule("on_fibre", "{found} of the fibre lies on other fibre of its direction"),
    _Rule("across_fibre", "{found} of the fibre lies across other fibre"),
    _Rule("outside", "{found} of the strands, by their width, lies outside the part"),
    _Rule(
        "outside_height",
        "{found} of the fibre stands out of the part's top or bottom, with strands "
        "{machine.strand_height:.2g} mm high",
    ),
    _Rule("free_span", "fibre hangs free over {found}", "{:.3g} mm"),
    _Rule("links", "{found} of the fibre is marked as links"),
    _Rule("fraction", "a fibre volume fraction of {found}", "{:.2f}"),
)


def why_not(total: Mapping[str, float], machine: Machine) -> tuple[str, ...]:
    """Say what keeps paths from being printed as they are, the worst first.

    Parameters
    ----------
    total : mapping
        Indices of the whole part (`Evaluation.total`).
    machine : Machine
        With its limits.

    Returns
    -------
    tuple of str
        Each names what was found and what the machine tolerates. An index that is NaN, as without
        fibre, breaks no limit.
    """
    reasons = _bounded_values(total)
    broken = []
    for rule in _RULES:
        value, limit = reasons[rule.limit], getattr(machine.limits, rule.limit)
        if value > limit:
            reason = rule.words.format(found=rule.pattern.format(value), machine=machine)
            excess = value / limit if limit > 0.0 else float("inf")
            broken.append((-excess, f"{reason} (limit {rule.pattern.format(limit)})"))
    if reasons["order"] > 0.0:
        reason = f"{reasons['order']:.0f} paths come after one of a higher layer"
        broken.append((-float("inf"), reason))
    # Flat layers may be thick: matrix fills them in several lines.
    thick = total["thickness_95"]
    if total["tilt_mean"] > 0.0 and thick > machine.matrix_width:
        reason = (
            f"curved layers up to {thick:.2g} mm thick, more than a line of matrix is wide "
            f"({machine.matrix_width:g} mm): cut more layers"
        )
        broken.append((-thick / machine.matrix_width, reason))
    return tuple(reason for _, reason in sorted(broken))


def _bounded_values(total: Mapping[str, float]) -> dict[str, float]:
    """Value that each limit bounds."""
    links = total["link_inside"] + total["link_over_void"] + total["link_outside"]
    length = total["fibre_length"]
    return {
        "short": 1.0 - total["long_enough_length"],
        "tight": 1.0 - total["curvature_ok"],
        "on_fibre": total["on_fibre"],
        "across_fibre": total["across_fibre"],
        "outside": total["outside_width"],
        "outside_height": total["outside_height"],
        "free_span": total["free_span"],
        "links": links / length if length > 0.0 else 0.0,
        "fraction": total["fibre_fraction_99"],
        "order": total["out_of_order"],
    }
