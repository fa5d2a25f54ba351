"""A single dial for how much fibre a strategy lays, over all parameters named in its amount."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ccfem.paths.planning.strategy import Strategy

_POWERS = (0.5, 3.0)
"""Bounds of the power of the parameter that the length is assumed to be proportional to."""


def around(lengths: Mapping[float, float], target: float) -> tuple[float | None, float | None]:
    """Find the turn of longest length up to a target, and that of the next length above."""
    low = [turn for turn in lengths if lengths[turn] <= target]
    high = [turn for turn in lengths if lengths[turn] > target]
    return (
        max(low, key=lambda turn: (lengths[turn], turn), default=None),
        min(high, key=lambda turn: (lengths[turn], turn), default=None),
    )


@dataclass(frozen=True)
class Dial:
    """Amount of fibre that a strategy lays: 0 is its least, 1 its amount's most, then `beyond`.

    Between 0 and 1 the parameter of the amount goes from its least to its most, evenly in its
    logarithm where both are positive: the length is then about exponential in the turn of the dial.
    From each whole number on, one of the parameters in `beyond` goes evenly from the strategy's own
    value to its most.

    Attributes
    ----------
    strategy : Strategy
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
        told = [n for n in names if getattr(strategy, n) != getattr(self.strategy, n)]
        return ", ".join(f"{n} = {getattr(strategy, n):.6g}" for n in told or names[:1])

    def guess(self, lengths: Mapping[float, float], target: float, beyond: float = 0.0) -> float:
        """Turn at which the length may be the target.

        Parameters
        ----------
        lengths : mapping of turn to float, mm
            Known lengths, at least one.
        target : float, mm
        beyond : float, default 0
            Share by which to overshoot while lengths are known on one side of the target only, so
            that it comes to lie between two of them.

        Returns
        -------
        float
            A turn between the nearest known lengths on both sides. While one side is unknown, it
            follows in proportion from the nearest length, or is an end of the dial.
        """
        low, high = around(lengths, target)
        if low is not None and high is not None:
            a, b = lengths[low], lengths[high]
            even = self._even or max(low, high) > 1.0 or not a > 0.0
            share = (target - a) / (b - a) if even else np.log(target / a) / np.log(b / a)
            return float(low + np.clip(share, 0.05, 0.95) * (high - low))
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
        found = np.log(lengths[near[1]] / lengths[near[0]]) / (near[1] - near[0])
        # Where the length changes in steps two values say little about the next.
        return float(np.clip(found, _POWERS[0] * slope, _POWERS[1] * slope))
