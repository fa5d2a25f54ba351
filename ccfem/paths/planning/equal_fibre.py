"""Planning to a wanted length of fibre, so that strategies are compared at equal cost.

A strategy that lays more fibre wins almost any comparison. Every strategy therefore names the
parameter that sets how much it lays (`Strategy.amount`), and `plan_to_length` searches for its
value. A `LengthStrategy` takes the length itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.polylines import along_line
from ccfem.machine.machine import Machine
from ccfem.paths.planning.bracketing import around, close_in, interpolated
from ccfem.paths.planning.infill import about_short_pieces
from ccfem.paths.planning.layer_plans import check_layers, plan, plan_layers
from ccfem.paths.planning.strategy import LengthStrategy, Planned, Strategy
from ccfem.paths.planning.unfolding import may_fold
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

# Plans mixed to a length in between: some layers from one, the others from the other.


_SPARE = 0.005
"""Share of the wanted length that may stay unused before strands are cut to fill it."""
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
"""Multiples of the golden ratio spread any number of layers over the stack."""


@dataclass(frozen=True)
class Mixed:
    """Toolpaths of which some layers come from the longer plan, the others from the shorter one.

    The numbers of layers from the longer plan, and of those on which strands are cut back.
    """

    toolpaths: Toolpaths
    more: int
    cut: int


def layer_lengths(toolpaths: Toolpaths, layers: Sequence[Layer]) -> FloatArray:
    """Length of fibre on each layer, (n,), mm."""
    index = [layer.index for layer in layers]
    fibre = toolpaths.of_kind(FIBRE)
    by_index = np.bincount(fibre.layer, fibre.lengths, minlength=max(index, default=0) + 1)
    return np.asarray(by_index[index], dtype=np.float64)


def mixed(
    less: Toolpaths, more: Toolpaths, layers: Sequence[Layer], total: float, minimum: float
) -> Mixed:
    """Mix two plans to a length; layers from the longer plan are spread evenly over the stack.

    Layers that the shorter plan leaves empty are always taken from the longer one. Where whole
    layers leave more than half a per cent unused, one more layer takes strands that are cut to fit,
    to no less than a minimum, mm. Where the always-taken layers already exceed the length, strands
    are cut back on all layers. The total, mm, is exceeded only where the minimum on layers that
    would be empty requires it.
    """
    a, b = layer_lengths(less, layers), layer_lengths(more, layers)
    taken = (a == 0.0) & (b > 0.0)
    room = total - float(np.where(taken, b, a).sum())
    if room < 0.0:
        return _cut_evenly(less, more, layers, taken, total, minimum)
    for k in np.argsort((np.arange(len(layers)) * _GOLDEN) % 1.0, kind="stable"):
        gain = b[k] - a[k]
        if not taken[k] and 0.0 < gain <= room:
            taken[k], room = True, room - gain
    parts = _parts(less, more, layers, taken)
    gain = np.where(taken, 0.0, b - a)
    cut = 0
    for k in np.argsort(gain, kind="stable"):
        if gain[k] <= 0.0 or room <= _SPARE * total:
            continue
        shorter = cut_to_length(more.on_layer(layers[k].index), a[k] + room, minimum)
        won = float(shorter.of_kind(FIBRE).lengths.sum()) - a[k]
        if won > 0.0:
            parts[k], taken[k], room, cut = shorter, True, room - won, cut + 1
    return Mixed(Toolpaths.concatenate(parts), int(taken.sum()), cut)


def _parts(
    less: Toolpaths, more: Toolpaths, layers: Sequence[Layer], taken: Sequence[bool]
) -> list[Toolpaths]:
    return [
        (more if chosen else less).on_layer(layer.index)
        for layer, chosen in zip(layers, taken, strict=True)
    ]


def _cut_evenly(
    less: Toolpaths,
    more: Toolpaths,
    layers: Sequence[Layer],
    taken: Sequence[bool],
    total: float,
    minimum: float,
) -> Mixed:
    """Cut the strands of every layer back in the same proportion, but none completely."""
    parts = _parts(less, more, layers, taken)
    lengths = np.array([float(part.of_kind(FIBRE).lengths.sum()) for part in parts])
    share, carried, cut = total / float(lengths.sum()), 0.0, 0
    for k, part in enumerate(parts):
        wanted = max(share * lengths[k] + carried, min(lengths[k], minimum))
        parts[k] = cut_to_length(part, wanted, minimum)
        left = float(parts[k].of_kind(FIBRE).lengths.sum())
        carried += share * lengths[k] - left
        cut += left < lengths[k]
    return Mixed(Toolpaths.concatenate(parts), int(np.sum(taken)), cut)


# Paths cut back to a wanted length so that all remaining pieces can be printed.


_ENOUGH = 1e-9
"""Length, mm, below which nothing more is cut."""
_SAME = 1e-6
"""Distance along a path, mm, within which a cut is moved to a point of the path."""


def cut_to_length(toolpaths: Toolpaths, length: float, minimum: float) -> Toolpaths:
    """Leave out and shorten fibre until no more than a length, mm, is left.

    The shortest paths are left out as a whole. The remaining excess is cut from the end of the
    shortest path that stays as long as the minimum, mm, or from the ends of several. No path ends
    in a link, and a closed path becomes open when cut. Less than the length is left where paths of
    at least the minimum cannot add up to it.
    """
    size = np.where(toolpaths.kind == FIBRE, toolpaths.lengths, 0.0)
    left = _lengths(size, length, minimum)
    changed = np.flatnonzero(left < size - _ENOUGH)
    return _shortened(toolpaths, {int(k): float(left[k]) for k in changed}, minimum)


def _lengths(size: FloatArray, length: float, minimum: float) -> FloatArray:
    """Remaining lengths of paths of the given sizes."""
    left, excess = size.copy(), float(size.sum()) - length
    for k in np.argsort(np.where(size > 0.0, size, np.inf), kind="stable"):
        if excess <= _ENOUGH:
            break
        spare = np.where(left > 0.0, np.maximum(left - minimum, 0.0), 0.0)
        if left[k] > excess and spare.sum() >= excess - _ENOUGH:
            alone = np.flatnonzero(spare >= excess - _ENOUGH)
            if len(alone):
                left[alone[np.argmin(left[alone])]] -= excess
            else:
                left -= spare * (excess / spare.sum())
            break
        excess -= left[k]
        left[k] = 0.0
    return left


def _shortened(toolpaths: Toolpaths, wanted: dict[int, float], minimum: float) -> Toolpaths:
    """Toolpaths, some of them cut to a wanted initial length, by path number; 0 removes a path."""
    if not wanted:
        return toolpaths
    points, keep = toolpaths.points.copy(), np.ones(len(toolpaths.points), dtype=bool)
    link, closed = toolpaths.link.copy(), toolpaths.closed.copy()
    for k, length in wanted.items():
        first, end = toolpaths.offsets[k], toolpaths.offsets[k + 1]
        line = toolpaths.points[first:end]
        along = along_line(line)
        last = max(int(np.searchsorted(along, length - _SAME)), 1)
        share = min((length - along[last - 1]) / (along[last] - along[last - 1]), 1.0)
        # A path does not end on a link: back to where it begins. Else at the exact length.
        if toolpaths.link[first + last - 1]:
            while last > 0 and toolpaths.link[first + last - 1]:
                last -= 1
            length = along[last]
        else:
            points[first + last] = line[last - 1] + share * (line[last] - line[last - 1])
        if length <= _SAME or length < minimum - _SAME:
            keep[first:end] = False
            continue
        keep[first + last + 1 : end], link[first + last], closed[k] = False, False, False
    return replace(toolpaths, points=points, link=link, closed=closed).with_points(keep)


# A single dial for how much fibre a strategy lays, over all parameters named in its amount.


_POWERS = (0.5, 3.0)
"""Bounds of the power of the parameter that the length is assumed to be proportional to."""


@dataclass(frozen=True)
class Dial:
    """Amount of fibre that a strategy lays: 0 is its least, 1 its amount's most, then `beyond`.

    Between 0 and 1 the parameter of the amount goes from its least to its most, evenly in its
    logarithm where both are positive: the length is then about exponential in the turn of the dial.
    From each whole number on, one of the parameters in `beyond` goes evenly from the strategy's own
    value to its most.
    """

    strategy: Strategy

    @cached_property
    def own(self) -> float:
        """Turn of the strategy itself; its most where its parameter is None."""
        value = getattr(self.strategy, self.strategy.amount.parameter)
        if value is None:
            return 1.0
        first, last = self._ends
        if self._even:
            return float((value - first) / (last - first))
        return float(np.log(value / first) / np.log(last / first))

    @cached_property
    def end(self) -> float:
        """Turn at which the strategy lays its most."""
        return 1.0 + len(self.strategy.amount.beyond)

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Least and most of the amount's parameter, extended to the strategy's own value."""
        amount = self.strategy.amount
        value = getattr(self.strategy, amount.parameter)
        ends = [amount.least, amount.most] if value is None else [amount.least, amount.most, value]
        low, high = float(min(ends)), float(max(ends))
        return (low, high) if amount.most > amount.least else (high, low)

    @property
    def _even(self) -> bool:
        return min(self._ends) <= 0.0

    def at(self, turn: float) -> Strategy:
        """Return the strategy at a turn of the dial, from 0 to `end`."""
        amount = self.strategy.amount
        if turn == self.own:
            return self.strategy
        first, last = self._ends
        share = min(turn, 1.0)
        value = first + share * (last - first) if self._even else first * (last / first) ** share
        value = {0.0: first, 1.0: last}.get(share, value)
        values: dict[str, Any] = {amount.parameter: value}
        for k, (parameter, most) in enumerate(amount.beyond, start=1):
            start = getattr(self.strategy, parameter)
            share = float(np.clip(turn - k, 0.0, 1.0))
            value = most if share == 1.0 else start + share * (most - start)
            values[parameter] = round(value) if isinstance(start, int) else value
        changed: Any = replace(self.strategy, **values)  # type: ignore[type-var]
        return changed

    def says(self, strategy: Strategy) -> str:
        """Return the parameters in which a strategy on this dial differs, or else the first one."""
        amount = self.strategy.amount
        names = [amount.parameter, *(name for name, _ in amount.beyond)]
        changed = [n for n in names if getattr(strategy, n) != getattr(self.strategy, n)]
        return ", ".join(f"{n} = {getattr(strategy, n):.6g}" for n in changed or names[:1])

    def guess(self, lengths: Mapping[float, float], target: float, beyond: float = 0.0) -> float:
        """Turn at which the length may be the target, mm, by the lengths, mm, at some turns.

        It lies between the nearest known lengths on both sides. While one side is unknown, it
        follows in proportion from the nearest length, overshot by the share `beyond`, so that the
        target comes to lie between two of them, or is an end of the dial.
        """
        low, high = around(lengths, target)
        if low is not None and high is not None:
            a, b = lengths[low], lengths[high]
            even = self._even or max(low, high) > 1.0 or not a > 0.0
            return interpolated((low, high), (a, b), target, even)
        known = low if low is not None else high
        assert known is not None
        if known >= 1.0 and low is not None:
            return float(min(np.floor(known) + 1.0, self.end))
        if self._even or not lengths[known] > 0.0:
            return 0.0 if low is None else 1.0
        aim = target * (1.0 - beyond if low is None else 1.0 + beyond)
        turn = known + np.log(aim / lengths[known]) / self._slope(lengths, target)
        return float(np.clip(turn, 0.0, 1.0))

    def _slope(self, lengths: Mapping[float, float], target: float) -> float:
        """Change of the logarithm of the length over a turn from 0 to 1."""
        first, last = self._ends
        slope = abs(float(np.log(last / first)))
        near = [t for t in lengths if t <= 1.0 and lengths[t] > 0.0]
        near = sorted(near, key=lambda t: abs(np.log(lengths[t] / target)))[:2]
        if len(near) < 2:
            return slope
        secant = np.log(lengths[near[1]] / lengths[near[0]]) / (near[1] - near[0])
        # Where the length changes in steps two values say little about the next.
        return float(np.clip(secant, _POWERS[0] * slope, _POWERS[1] * slope))


TOLERANCE = 0.01
"""Share by which a length may differ from the wanted one and still count as equal."""
_GUESSES = 3
"""Plans of the whole stack tried from a known plan before a search."""
_CLOSE = 0.1
"""Difference of two plans on either side of the wanted length, as a share of it, up to which some
layers may take one plan and some the other without further search."""
_ROUNDS = 3
"""Plans of the whole stack after a search on a few layers."""
_STEPS = 8
"""Plans of the few layers that represent the stack, in each round."""
_FINEST = 1e-5
"""Turn of the dial below which a jump in length is accepted as such."""
_BEYOND = 0.05
"""Overshoot of these while lengths are known on one side of the wanted one only, as a share."""
_HALVINGS = 6
"""Plans of the whole stack in the search for the least that leaves no layer empty."""
_FEW = 4
"""Number of layers up to which the whole stack is searched directly."""


def length_per_layer(toolpaths: Toolpaths, layers: Sequence[Layer]) -> float:
    """Fibre length divided by the number of layers, mm."""
    return float(toolpaths.of_kind(FIBRE).lengths.sum()) / max(len(layers), 1)


def check_wanted(wanted: float) -> None:
    """Refuse a wanted length per layer, mm, that is not a positive number."""
    check_number("fibre per layer", wanted, above=0.0, unit="mm")


def plan_to_length(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    wanted: float,
    start: Planned | None = None,
    tolerance: float = TOLERANCE,
    sampled: float | None = None,
    alike: IntArray | None = None,
) -> Planned:
    """Plan to a wanted length of fibre.

    Plans are searched on both sides of the wanted length, on a few layers unless plans of the whole
    stack are known. Some layers, spread evenly, then take the plan that lays more. Where that
    leaves room, strands are cut to fit it, but never below the shortest that can be printed. No
    layer is left empty that one of the plans fills.

    Parameters
    ----------
    strategy : Strategy
        The search starts from its own value.
    wanted : float, mm
        Fibre per layer: mean over the stack. It is met within the share `tolerance` and not
        exceeded, if it lies between the least and the most that the strategy lays. Otherwise the
        nearer of these is laid, and `Planned.reached` and `note` say so.
    start : Planned, optional
        The plan of the strategy with its own value, if it exists already.
    tolerance : float, default 0.01
        Share by which less may be laid.
    sampled : float, mm, optional
        Length on a few layers with the strategy's own value (`sampled_length`), if known.
    alike : (n,) int array, optional
        As of `plan`.
    """
    known = () if start is None else (start,)
    about = (known, tolerance, sampled, alike)
    return plan_to_lengths(strategy, layers, stress, machine, (wanted,), *about)[0]


def sampled_length(
    strategy: Strategy, layers: Sequence[Layer], stress: PartStress, machine: Machine
) -> float | None:
    """Length per layer that a strategy lays with its own value, mm, judged by a few layers.

    None where the stack is small and they are all there are. Parameters as in `plan_to_length`.
    """
    search = _Search(Dial(strategy), layers, stress, machine)
    return None if search.few is layers else search.sample(search.dial.own)


def plan_to_lengths(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    lengths: Sequence[float],
    known: Sequence[Planned] = (),
    tolerance: float = TOLERANCE,
    sampled: float | None = None,
    alike: IntArray | None = None,
) -> list[Planned]:
    """Plan to several lengths of fibre, mm per layer, reusing the plans for one for the others.

    Plans of the strategy with its own value, or at its extremes, may be known. The other parameters
    are those of `plan_to_length`.
    """
    for wanted in lengths:
        check_wanted(wanted)
    if isinstance(strategy, LengthStrategy):
        check_layers(strategy, layers, machine)
        part = (layers, stress, machine)
        plans = _plans_at_lengths(strategy, *part, lengths)
        return [
            plan if plan.reached else _by_cutting(strategy, plan, *part, wanted)
            for plan, wanted in zip(plans, lengths, strict=True)
        ]
    search = _Search(Dial(strategy), layers, stress, machine, tolerance, alike)
    search.learn(known)
    if sampled is not None:
        search.sampled[search.dial.own] = sampled
    return [search.to(wanted) for wanted in lengths]


def extremes(
    strategy: Strategy, layers: Sequence[Layer], stress: PartStress, machine: Machine
) -> tuple[Planned, Planned]:
    """Plan the least and the most that a strategy lays; parameters as in `plan_to_lengths`."""
    search = _Search(Dial(strategy), layers, stress, machine)
    most = max(search.whole(search.dial.end), *search.tried.values(), key=_length)
    return search.least_filled(), most


def _length(planned: Planned) -> float:
    return planned.length_per_layer


_LONGER = 1.05
"""Share of the length wanted that is asked for where the plan to the length itself lays less."""

_IN_REACH = 0.9
"""Share of the length wanted from which a plan may reach it by a longer one that is cut."""


def _plans_at_lengths(
    strategy: LengthStrategy,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    lengths: Sequence[float],
) -> list[Planned]:
    """Plan a strategy that takes the length itself."""
    planners = strategy.to_lengths(stress, layers, machine, lengths)
    plans = []
    for (asked, planner), wanted in zip(planners, lengths, strict=True):
        paths = plan_layers(planner, layers, layers, stress, machine, may_fold(asked))
        plans.append(_plan_at_length(asked, paths, layers, machine, wanted))
    return plans


def _by_cutting(
    strategy: LengthStrategy,
    plan: Planned,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    wanted: float,
) -> Planned:
    """Plan to somewhat more and cut that to the length; the plan itself if that does not reach it.

    Strands that are worth all or nothing leave room that the next longer plan does not have. A plan
    far short of it lays its most, and a longer one would not be worth its time.
    """
    if plan.length_per_layer < _IN_REACH * wanted:
        return plan
    longer = _plans_at_lengths(strategy, layers, stress, machine, [_LONGER * wanted])[0]
    if longer.length_per_layer < wanted:
        return plan
    whole = wanted * len(layers)
    paths = cut_to_length(longer.toolpaths, whole, machine.shortest_strand)
    cut = _plan_at_length(longer.strategy, paths, layers, machine, wanted)
    return cut if cut.reached else plan


def _plan_at_length(
    strategy: Strategy,
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    machine: Machine,
    wanted: float,
) -> Planned:
    """Plan of a strategy that was told the length."""
    length = length_per_layer(toolpaths, layers)
    if _meets(length, wanted):
        return Planned(strategy, toolpaths, length)
    note = about_shortfall(length, wanted, layers, machine)
    return Planned(strategy, toolpaths, length, note, reached=False)


def about_lengths(length: float, wanted: float) -> str:
    """Say which length is laid and which was asked for, mm per layer."""
    asked = f"{wanted:.0f}" if wanted >= 10.0 else f"{wanted:.3g}"
    return f"lays {length:.0f} of {asked} mm per layer"


def _of_strands(machine: Machine) -> str:
    return f"the nearest that strands of {machine.shortest_strand:g} mm allow"


def about_shortfall(
    length: float, wanted: float, layers: Sequence[Layer], machine: Machine, cases: str = ""
) -> str:
    """Say why less is laid than was asked for: no more fits, or a strand more would be too much.

    Lengths are mm per layer; `cases` says what the plan is for, where that is several load cases.
    """
    if (wanted - length) * len(layers) < machine.shortest_strand:
        return f"{about_lengths(length, wanted)}: {_of_strands(machine)}"
    most = f"{about_lengths(length, wanted)}: its most{cases}"
    return most + about_short_pieces(layers, machine)


def _meets(length: float, wanted: float, tolerance: float = TOLERANCE) -> bool:
    return (1.0 - tolerance) * wanted <= length <= wanted * (1.0 + 1e-9)


@dataclass
class _Search:
    """Plans of one strategy at several turns of its dial, while a length is searched for."""

    dial: Dial
    layers: Sequence[Layer]
    stress: PartStress
    machine: Machine
    tolerance: float = TOLERANCE
    alike: IntArray | None = None
    tried: dict[float, Planned] = field(default_factory=dict)
    sampled: dict[float, float] = field(default_factory=dict)

    def learn(self, known: Sequence[Planned]) -> None:
        """Take over known plans."""
        for turn in (self.dial.own, 0.0, self.dial.end):
            for attempt in known:
                if attempt.strategy == self.dial.at(turn):
                    self.tried.setdefault(turn, attempt)

    @cached_property
    def few(self) -> Sequence[Layer]:
        """Layers that represent the stack."""
        layers = self.layers
        return layers if len(layers) <= _FEW else [layers[0], layers[len(layers) // 2], layers[-1]]

    def whole(self, turn: float) -> Planned:
        """Plan of the whole stack."""
        if turn not in self.tried:
            strategy = self.dial.at(turn)
            same = [one for one in self.tried.values() if one.strategy == strategy]
            if same:  # a parameter of whole numbers
                self.tried[turn] = same[0]
            else:
                paths = plan(strategy, self.layers, self.stress, self.machine, self.alike)
                length = length_per_layer(paths, self.layers)
                self.tried[turn] = Planned(strategy, paths, length)
        return self.tried[turn]

    def sample(self, turn: float) -> float:
        """Length per layer on the few layers, mm."""
        if turn not in self.sampled:
            known = self.whole(turn) if self.few is self.layers else self.tried.get(turn)
            if known is None:
                paths = plan(self.dial.at(turn), self.few, self.stress, self.machine)
                self.sampled[turn] = length_per_layer(paths, self.few)
            else:
                self.sampled[turn] = float(layer_lengths(known.toolpaths, self.few).mean())
        return self.sampled[turn]

    def meets(self, length: float, wanted: float) -> bool:
        return _meets(length, wanted, self.tolerance)

    def lengths(self) -> Mapping[float, float]:
        return {turn: attempt.length_per_layer for turn, attempt in self.tried.items()}

    def filled(self, attempt: Planned) -> bool:
        """Whether a plan lays fibre on every layer that any known one does."""
        plans = (attempt, *self.tried.values())
        filled = [layer_lengths(plan.toolpaths, self.layers) > 0.0 for plan in plans]
        return bool((filled[0] >= np.any(filled, axis=0)).all())

    def least_filled(self) -> Planned:
        """Plan with the least fibre that leaves no layer empty which some amount fills."""
        self.whole(0.0)
        full = [turn for turn in self.tried if self.filled(self.tried[turn])]
        low, high = 0.0, min(full, default=self.dial.end)
        for _ in range(_HALVINGS if high > 0.0 else 0):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.filled(self.whole(middle)) else (middle, high)
        plans = list(self.tried.values())
        return min([attempt for attempt in plans if self.filled(attempt)] or plans, key=_length)

    def to(self, wanted: float) -> Planned:
        """Plan to a length per layer, mm."""
        if self.tried:
            for _ in range(_GUESSES):
                planned = self.between(wanted, _CLOSE)
                if planned is not None:
                    return planned
                turn = self.dial.guess(self.lengths(), (1.0 - 0.5 * self.tolerance) * wanted)
                if turn in self.tried:
                    break
                self.whole(turn)
        return self.between(wanted, _CLOSE) or self.searched(wanted)

    def searched(self, wanted: float) -> Planned:
        """Search on the few layers and check on the stack; repeat with the ratio of the two."""
        for _ in range(1 if self.few is self.layers else _ROUNDS):
            for turn in self.bracket(wanted / self.ratio(wanted)):
                if turn is not None:
                    self.whole(turn)
                    planned = self.between(wanted, _CLOSE)
                    if planned is not None:
                        return planned
        if not any(attempt.length_per_layer <= wanted for attempt in self.tried.values()):
            self.whole(0.0)
        if not any(attempt.length_per_layer >= wanted for attempt in self.tried.values()):
            self.whole(self.dial.end)
        return self.between(wanted, np.inf) or self.off(wanted)

    def ratio(self, wanted: float) -> float:
        """Length on the stack over that on the few layers, for the nearest known plan."""
        off = {
            turn: abs(attempt.length_per_layer - wanted)
            for turn, attempt in self.tried.items()
            if self.sample(turn) > 0.0 and attempt.length_per_layer > 0.0
        }
        if not off:
            return 1.0
        nearest = min(off, key=off.__getitem__)
        return self.tried[nearest].length_per_layer / self.sample(nearest)

    def bracket(self, target: float) -> tuple[float | None, float | None]:
        """Find turns on either side of a length on the few layers, as near as a few steps allow."""
        known, least = self.sampled, (1.0 - 0.5 * self.tolerance) * target

        def following(step: int) -> float | None:
            low, high = around(known, target)
            if low is not None and high is not None:
                if abs(high - low) <= _FINEST:
                    return None
                if step % 3 == 2:  # so that a curved relation cannot stall the search
                    return 0.5 * (low + high)
            if low is None and step == _STEPS - 2:  # out of proportion: the end itself
                return 0.0
            return self.dial.guess(known, target, _BEYOND)

        def measured(turn: float) -> tuple[float, float]:
            return turn, self.sample(turn)

        close_in(known, measured, min(self.dial.own, 1.0), following, (least, target), _STEPS)
        return around(known, target)

    def between(self, wanted: float, close: float) -> Planned | None:
        """Mix the known plans on either side of a length, if they are close enough."""
        plans, most = self.tried.values(), wanted * (1 + 1e-9)
        below = [attempt for attempt in plans if attempt.length_per_layer <= most]
        above = [attempt for attempt in plans if attempt.length_per_layer > most]
        less = max(below, key=_length, default=None)
        more = min(above, key=_length, default=None)
        if less is not None and self.meets(less.length_per_layer, wanted) and self.filled(less):
            return less
        if less is None or more is None:
            return None
        if more.length_per_layer - less.length_per_layer > close * wanted:
            return None
        count, least = len(self.layers), self.machine.shortest_strand
        planned = mixed(less.toolpaths, more.toolpaths, self.layers, wanted * count, least)
        length = length_per_layer(planned.toolpaths, self.layers)
        if not self.meets(length, wanted) and np.isfinite(close):
            return None
        remark = f"{self.dial.says(more.strategy)} on {planned.more} of {count} layers"
        if planned.cut:
            remark += f", strands cut back on {planned.cut}"
        if not self.meets(length, wanted):
            remark += f"; {about_lengths(length, wanted)}: {_of_strands(self.machine)}"
        return Planned(less.strategy, planned.toolpaths, length, remark, self.meets(length, wanted))

    def off(self, wanted: float) -> Planned:
        """Return the extreme plan nearest to a length that the strategy does not reach."""
        plans = [self.tried[turn] for turn in sorted(self.tried)]
        much = min(map(_length, plans)) > wanted
        best = min(plans, key=_length) if much else max(plans[::-1], key=_length)
        length, end = best.length_per_layer, "least" if much else "most"
        note = f"{about_lengths(length, wanted)}: its {end}, at {self.dial.says(best.strategy)}"
        return Planned(best.strategy, best.toolpaths, length, note, reached=False)
