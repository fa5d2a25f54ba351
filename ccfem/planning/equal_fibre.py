"""Planning to a wanted length of fibre, so that strategies are compared at equal cost.

A strategy that lays more fibre wins almost any comparison. Every strategy therefore names the
parameter that sets how much it lays (`Strategy.amount`), and `plan_to_length` searches its value.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ccfem.arrays import in_brief
from ccfem.checks import check_number
from ccfem.elasticity.part_stress import PartStress
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.planning.plan import plan
from ccfem.planning.strategy import Amount, Strategy
from ccfem.toolpaths import FIBRE, Toolpaths

__all__ = ["TOLERANCE", "Planned", "check_wanted", "length_per_layer", "plan_to_length"]

TOLERANCE = 0.01
"""Share by which the length may fall short before the search stops."""
_GUESSES = 3
"""Plans of the whole stack from a known one, before anything is searched."""
_CLOSE = 0.1
"""Difference of two plans on either side of the wanted length, as a share of it, up to which some
layers may take the one and some the other without a further search."""
_ROUNDS = 3
"""Plans of the whole stack."""
_STEPS = 8
"""Plans of the few layers that stand for the stack, in each round."""
_FINEST = 1e-5
"""Share of the parameter's range below which a step in length is taken for what it is."""
_POWERS = (0.5, 3.0)
"""Bounds of the power of the parameter that the length is taken to go with."""
_FEW = 4
"""Stacks of at most this many layers are searched as they are."""


@dataclass(frozen=True)
class Planned:
    """Toolpaths of a part, and the strategy that made them.

    Attributes
    ----------
    strategy : Strategy
        With the value of its amount parameter that was found (of most layers, see `note`).
    toolpaths : Toolpaths
    length_per_layer : float, mm
        Fibre length divided by the number of layers.
    note : str
        Empty, or one line: which layers have another value, or why the wanted length was missed.
    """

    strategy: Strategy
    toolpaths: Toolpaths
    length_per_layer: float
    note: str = ""

    __repr__ = in_brief


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
) -> Planned:
    """Plan with the value of the amount parameter that lays at most the wanted fibre.

    Where a plan of the whole stack is known, a few guesses are made from it. As soon as two plans
    lie close on either side of the wanted length, some layers, evenly spread, take the one that
    lays more. Otherwise the value is searched on the bottom, middle and top layer, then checked on
    the whole stack; the ratio of the two lengths corrects the next search. Of the values tried on
    the whole stack, the one that lays most without laying too much is kept. Where the length
    changes in steps (one contour more or less) and that leaves too much missing, again some layers
    take the next value that lays more; where even the least is too much, some layers stay without
    fibre.

    Parameters
    ----------
    strategy : Strategy
        Its own value is where the search starts.
    layers : sequence of Layer
    stress : PartStress
    machine : Machine
    wanted : float, mm
        Fibre per layer: mean over the stack. The search stops within the share `TOLERANCE` below
        it. A strategy may miss that: `Planned.note` says so.
    start : Planned, optional
        The strategy's plan with its own value, where there is one already.

    Returns
    -------
    Planned

    Raises
    ------
    InputError
        When `wanted` is not a positive number, or whatever the strategy raises.
    """
    check_wanted(wanted)
    trials = _Trials(strategy, layers, stress, machine, wanted)
    own = getattr(strategy, strategy.amount.parameter)
    if start is not None and own is not None:
        trials.tried[float(own)] = start
        near = trials.guess()
        if near is not None:
            return near
    return trials.search()


@dataclass
class _Trials:
    """Plans of one strategy with several values of its parameter, on the way to a length."""

    strategy: Strategy
    layers: Sequence[Layer]
    stress: PartStress
    machine: Machine
    wanted: float
    tried: dict[float, Planned] = field(default_factory=dict)
    sampled: dict[float, float] = field(default_factory=dict)

    @cached_property
    def few(self) -> Sequence[Layer]:
        """Layers that stand for the stack."""
        layers = self.layers
        return layers if len(layers) <= _FEW else [layers[0], layers[len(layers) // 2], layers[-1]]

    def planned(self, value: float, on: Sequence[Layer]) -> Planned:
        changed = _with_value(self.strategy, self.strategy.amount, value)
        toolpaths = plan(changed, on, self.stress, self.machine)
        return Planned(changed, toolpaths, length_per_layer(toolpaths, on))

    def sample(self, value: float) -> float:
        """Length per layer on the few layers, mm."""
        if value not in self.sampled:
            result = self.tried.get(value) or self.planned(value, self.few)
            if self.few is self.layers:
                self.tried[value] = result
            known = [result.toolpaths.on_layer(layer.index) for layer in self.few]
            self.sampled[value] = length_per_layer(Toolpaths.concatenate(known), self.few)
        return self.sampled[value]

    def meets(self, length: float) -> bool:
        return (1.0 - TOLERANCE) * self.wanted <= length <= self.wanted

    def guess(self) -> Planned | None:
        """Plan from one known plan of the stack, a few times at most; None where that fails."""
        target = self.wanted * (1.0 - 0.5 * TOLERANCE)
        for _ in range(_GUESSES):
            lengths = {value: one.length_per_layer for value, one in self.tried.items()}
            value = _by_power(lengths, self.strategy.amount, target)
            if value in self.tried:
                break
            self.tried[value] = self.planned(value, self.layers)
            reached = _between(list(self.tried.values()), self.layers, self.wanted)
            if self.meets(reached.length_per_layer):
                return reached
        return None

    def search(self) -> Planned:
        """Search on the few layers, check on the stack, and again with the ratio of the two."""
        amount, wanted, tried = self.strategy.amount, self.wanted, self.tried
        own = getattr(self.strategy, amount.parameter)
        value, margin = amount.most if own is None else float(own), 0.0
        ratio = self._ratio()
        for _ in range(1 if self.few is self.layers else _ROUNDS):
            target = wanted * (1.0 - margin) / ratio
            value = _search(self.sample, self.sampled, value, amount, target)
            if value in tried:
                break
            tried[value] = self.planned(value, self.layers)
            length = tried[value].length_per_layer
            if self.meets(length) or not self.sampled[value] > 0.0:
                break
            ratio, margin = length / self.sampled[value], 0.3 * TOLERANCE
        best = _best(list(tried.values()), wanted)
        if best.length_per_layer > wanted * (1.0 + 1e-9):
            best = _mixed(replace(best, toolpaths=Toolpaths.empty()), best, self.layers, wanted)
        elif best.length_per_layer < (1.0 - TOLERANCE) * wanted:
            best = self._raised(best, ratio)
        return replace(best, note=_note(best, amount, wanted))

    def _ratio(self) -> float:
        """Length on the stack over that on the few layers, where a plan is known."""
        lengths = {value: self.sample(value) for value in self.tried}
        if not any(lengths.values()):
            return 1.0
        off = {v: abs(self.tried[v].length_per_layer - self.wanted) for v in lengths if lengths[v]}
        nearest = min(off, key=off.__getitem__)
        return self.tried[nearest].length_per_layer / lengths[nearest]

    def _raised(self, best: Planned, ratio: float) -> Planned:
        """Plan that is too short, with layers of one that lays more where there is one."""
        above = [one for one in self.tried.values() if one.length_per_layer > self.wanted]
        if not above:
            values = [v for v in self.sampled if self.sampled[v] * ratio > self.wanted]
            nearest = min(values, key=self.sampled.__getitem__, default=None)
            above = [] if nearest is None else [self.planned(nearest, self.layers)]
        mixed = [best, *(_mixed(best, more, self.layers, self.wanted) for more in above)]
        return max(mixed, key=lambda one: one.length_per_layer)


def _between(tried: list[Planned], layers: Sequence[Layer], wanted: float) -> Planned:
    """Longest plan that is not too long, with layers of one that is where the two are close."""
    best = _best(tried, wanted)
    above = [one for one in tried if one.length_per_layer > wanted]
    more = min(above, key=lambda one: one.length_per_layer, default=best)
    if 0.0 < more.length_per_layer - best.length_per_layer <= _CLOSE * wanted:
        return _mixed(best, more, layers, wanted)
    return best


def _mixed(less: Planned, more: Planned, layers: Sequence[Layer], wanted: float) -> Planned:
    """Take as many layers as fit, evenly spread, from a plan that lays more."""
    count, index = len(layers), [layer.index for layer in layers]
    each = [
        np.bincount(one.toolpaths.layer, one.toolpaths.lengths, minlength=max(index) + 1)[index]
        for one in (less, more)
    ]
    chosen, room = np.zeros(count, dtype=bool), wanted * count - each[0].sum()
    # Multiples of the golden ratio spread any number of layers over the stack.
    for k in np.argsort((np.arange(count) * 0.5 * (np.sqrt(5.0) - 1.0)) % 1.0, kind="stable"):
        gain = each[1][k] - each[0][k]
        if 0.0 < gain <= room:
            chosen[k], room = True, room - gain
    if not chosen.any():
        return less if len(less.toolpaths) else more
    toolpaths = Toolpaths.concatenate(
        (more if taken else less).toolpaths.on_layer(k)
        for k, taken in zip(index, chosen, strict=True)
    )
    amount = less.strategy.amount.parameter
    note = f"{amount} = {getattr(more.strategy, amount):.6g} on {chosen.sum()} of {count} layers"
    note += "" if len(less.toolpaths) else ", no fibre on the others"
    return Planned(less.strategy, toolpaths, length_per_layer(toolpaths, layers), note)


def _with_value(strategy: Strategy, amount: Amount, value: float) -> Strategy:
    changed: Any = replace(strategy, **{amount.parameter: value})  # type: ignore[type-var]
    return changed


def _best(tried: list[Planned], wanted: float) -> Planned:
    """Return the longest plan that is not too long, or else the shortest."""
    allowed = [one for one in tried if one.length_per_layer <= wanted * (1.0 + 1e-9)]
    if allowed:
        return max(allowed, key=lambda one: one.length_per_layer)
    return min(tried, key=lambda one: one.length_per_layer)


def _note(best: Planned, amount: Amount, wanted: float) -> str:
    length, value = best.length_per_layer, getattr(best.strategy, amount.parameter)
    if (1.0 - TOLERANCE) * wanted <= length <= wanted * (1.0 + 1e-9):
        return best.note
    mixed = f"{best.note}; " if best.note else ""
    reached = f"{mixed}lays {length:.0f} of {wanted:.0f} mm per layer"
    if value == amount.most and length < wanted:
        return f"{reached}: its most, at {amount.parameter} = {value:g}"
    if value == amount.least and length > wanted:
        return f"{reached}: its least, at {amount.parameter} = {value:g}"
    return f"{reached}: the nearest that its steps allow"


def _search(
    length: Callable[[float], float],
    known: Mapping[float, float],
    start: float,
    amount: Amount,
    target: float,
) -> float:
    """Value whose length is at most the target and within the tolerance, or the nearest found.

    `known` holds the lengths that `length` has been asked for. False position between the nearest
    known length on either side; while one side is unknown, a guess by proportion.
    """
    ends = min(amount.least, amount.most), max(amount.least, amount.most)
    enough = (1.0 - 0.5 * TOLERANCE) * target
    value = float(np.clip(start, *ends))
    for step in range(_STEPS):
        if value not in known and enough <= length(value) <= target:
            return value
        low = max((v for v in known if known[v] <= target), key=known.__getitem__, default=None)
        high = min((v for v in known if known[v] > target), key=known.__getitem__, default=None)
        if low is None or high is None:
            value = _by_proportion(known, amount, target, 0.05)
            if step == _STEPS - 2:  # out of proportion: the end itself is the last to be tried
                value = amount.most if high is None else amount.least
        elif known[low] >= enough or abs(high - low) <= _FINEST * (ends[1] - ends[0]):
            return low
        else:
            share = (target - known[low]) / (known[high] - known[low])
            # Every third step bisects, so that a curved relation cannot stall the search.
            share = 0.5 if step % 3 == 2 else float(np.clip(share, 0.1, 0.9))
            value = low + share * (high - low)
        if value in known:
            break
    return low if low is not None else min(known, key=known.__getitem__)


def _by_power(lengths: Mapping[float, float], amount: Amount, target: float) -> float:
    """Guess from known lengths: the length goes as a power of the parameter."""
    ends = min(amount.least, amount.most), max(amount.least, amount.most)
    nearest = sorted(lengths, key=lambda value: abs(lengths[value] - target))[:2]
    if ends[0] <= 0.0 or min(lengths[value] for value in nearest) <= 0.0:
        return _by_proportion(lengths, amount, target, 0.0)
    power = 1.0 if amount.most > amount.least else -1.0
    if len(nearest) == 2:
        (p, q), (a, b) = nearest, (lengths[value] for value in nearest)
        found = power * np.log(a / b) / np.log(p / q)
        # Where the length changes in steps two values say little about the next.
        power *= float(np.clip(found, *_POWERS))
    guess = nearest[0] * (target / lengths[nearest[0]]) ** (1.0 / power)
    return float(np.clip(guess, *ends))


def _by_proportion(
    known: Mapping[float, float], amount: Amount, target: float, beyond: float
) -> float:
    """Guess while one side is unknown: the length goes as the parameter or as its inverse.

    From the known value that is nearest to the unknown side, and a share `beyond` further, so that
    the target comes to lie between two known lengths; the end itself where there is no proportion.
    """
    ends = min(amount.least, amount.most), max(amount.least, amount.most)
    unknown = amount.most if min(known.values()) <= target else amount.least
    nearest = min(known, key=lambda value: abs(value - unknown))
    if not (known[nearest] > 0.0 and ends[0] > 0.0):
        return unknown
    factor = target / known[nearest]
    factor *= 1.0 + beyond if factor > 1.0 else 1.0 - beyond
    guess = nearest * factor if amount.most > amount.least else nearest / factor
    return float(np.clip(guess, *ends))
