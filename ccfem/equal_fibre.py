"""Planning to a wanted length of fibre, so that strategies are compared at equal cost.

A strategy that lays more fibre wins almost any comparison. Every strategy therefore names the
parameter that sets how much it lays (`Strategy.amount`), and `plan_to_length` searches its value.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError
from ccfem.layers.layer import Layer
from ccfem.machine import Machine
from ccfem.strategies.strategy import Amount, Strategy, plan
from ccfem.toolpaths import FIBRE, Toolpaths

__all__ = ["TOLERANCE", "Planned", "check_wanted", "length_per_layer", "plan_to_length"]

TOLERANCE = 0.01
"""Share by which the length may fall short before the search stops."""
_GUESSES = 2
"""Plans of the whole stack from a known one, before anything is searched."""
_ROUNDS = 3
"""Plans of the whole stack."""
_STEPS = 8
"""Plans of the few layers that stand for the stack, in each round."""
_FINEST = 1e-5
"""Share of the parameter's range below which a step in length is taken for what it is."""
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


def length_per_layer(toolpaths: Toolpaths, layers: Sequence[Layer]) -> float:
    """Fibre length divided by the number of layers, mm."""
    return float(toolpaths.of_kind(FIBRE).lengths.sum()) / max(len(layers), 1)


def check_wanted(wanted: float) -> None:
    """Refuse a wanted length per layer, mm, that is not a positive number."""
    if not (np.isfinite(wanted) and wanted > 0.0):
        raise InputError(f"fibre per layer must be a length above 0 mm; got {wanted:g}: correct it")


def plan_to_length(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: StressField,
    machine: Machine,
    wanted: float,
    tolerance: float = TOLERANCE,
    start: Planned | None = None,
) -> Planned:
    """Plan with the value of the amount parameter that lays at most the wanted fibre.

    Where a plan of the whole stack is known, two guesses are made from it. After that the value is
    searched on the bottom, middle and top layer, then checked on the whole stack; the
    ratio of the two lengths corrects the next search. Of the values tried on the whole stack, the
    one that lays most without laying too much is kept. Where the length changes in steps (one
    contour more or less) and that leaves too much missing, some layers, evenly spread, take the
    next value that lays more; where even the least is too much, some layers stay without fibre.

    Parameters
    ----------
    strategy : Strategy
        Its own value is where the search starts.
    layers : sequence of Layer
    stress : StressField
    machine : Machine
    wanted : float, mm
        Fibre per layer: mean over the stack.
    tolerance : float, default 0.01
        The search stops within this share below `wanted`. A strategy may miss it: `Planned.note`
        says so.
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
    few = layers if len(layers) <= _FEW else [layers[0], layers[len(layers) // 2], layers[-1]]
    amount = strategy.amount
    sampled: dict[float, float] = {}
    tried: dict[float, Planned] = {}

    def planned(value: float, on: Sequence[Layer]) -> Planned:
        changed = _with_value(strategy, amount, value)
        toolpaths = plan(changed, on, stress, machine)
        return Planned(changed, toolpaths, length_per_layer(toolpaths, on))

    def sample(value: float) -> float:
        if value not in sampled:
            result = planned(value, few)
            if few is layers:
                tried[value] = result
            sampled[value] = result.length_per_layer
        return sampled[value]

    own = getattr(strategy, amount.parameter)
    if start is not None and own is not None:
        tried[float(own)] = start
        for _ in range(_GUESSES):
            lengths = {value: one.length_per_layer for value, one in tried.items()}
            guess = _by_power(lengths, amount, wanted * (1.0 - 0.5 * tolerance))
            if guess in tried:
                break
            tried[guess] = planned(guess, layers)
            if (1.0 - tolerance) * wanted <= tried[guess].length_per_layer <= wanted:
                return tried[guess]
    value, ratio, margin = amount.most if own is None else float(own), 1.0, 0.0
    for _ in range(1 if few is layers else _ROUNDS):
        target = wanted * (1.0 - margin) / ratio
        value = _search(sample, sampled, value, amount, target, tolerance)
        if value in tried:
            break
        tried[value] = planned(value, layers)
        length = tried[value].length_per_layer
        if (1.0 - tolerance) * wanted <= length <= wanted or not sampled[value] > 0.0:
            break
        ratio, margin = length / sampled[value], 0.3 * tolerance
    best = _best(list(tried.values()), wanted)
    if best.length_per_layer > wanted * (1.0 + 1e-9):
        best = _mixed(replace(best, toolpaths=Toolpaths.empty()), best, layers, wanted)
    elif best.length_per_layer < (1.0 - tolerance) * wanted:
        above = [one for one in tried.values() if one.length_per_layer > wanted]
        if not above:
            values = [value for value in sampled if sampled[value] * ratio > wanted]
            above = [planned(min(values, key=sampled.__getitem__), layers)] if values else []
        mixed = [best, *(_mixed(best, more, layers, wanted) for more in above)]
        best = max(mixed, key=lambda one: one.length_per_layer)
    return replace(best, note=_note(best, amount, wanted, tolerance))


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


def _note(best: Planned, amount: Amount, wanted: float, tolerance: float) -> str:
    length, value = best.length_per_layer, getattr(best.strategy, amount.parameter)
    if (1.0 - tolerance) * wanted <= length <= wanted * (1.0 + 1e-9):
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
    tolerance: float,
) -> float:
    """Value whose length is at most the target and within the tolerance, or the nearest found.

    `known` holds the lengths that `length` has been asked for. False position between the nearest
    known length on either side; while one side is unknown, a guess by proportion.
    """
    ends = min(amount.least, amount.most), max(amount.least, amount.most)
    enough = (1.0 - 0.5 * tolerance) * target
    value = float(np.clip(start, *ends))
    for step in range(_STEPS):
        if value not in known and enough <= length(value) <= target:
            return value
        low = max((v for v in known if known[v] <= target), key=known.__getitem__, default=None)
        high = min((v for v in known if known[v] > target), key=known.__getitem__, default=None)
        if low is None or high is None:
            value = _by_proportion(known, amount, target, 0.05)
        elif known[low] >= enough or abs(high - low) <= _FINEST * (ends[1] - ends[0]):
            return low
        else:
            share = (target - known[low]) / (known[high] - known[low])
            # Every third step bisects, so that a curved relation cannot stall the search.
            share = 0.5 if step % 3 == 2 else float(np.clip(share, 0.1, 0.9))
            value = low + share * (high - low)
        if value in known:
            break
    return low if low is not None else value


def _by_power(lengths: Mapping[float, float], amount: Amount, target: float) -> float:
    """Guess from known lengths: the length goes as a power of the parameter."""
    ends = min(amount.least, amount.most), max(amount.least, amount.most)
    nearest = sorted(lengths, key=lambda value: abs(lengths[value] - target))[:2]
    if ends[0] <= 0.0 or min(lengths[value] for value in nearest) <= 0.0:
        return _by_proportion(lengths, amount, target, 0.0)
    power = 1.0 if amount.most > amount.least else -1.0
    if len(nearest) == 2:
        (p, q), (a, b) = nearest, (lengths[value] for value in nearest)
        power = np.log(a / b) / np.log(p / q) if a != b else power
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
