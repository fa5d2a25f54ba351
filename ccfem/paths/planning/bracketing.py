"""Search for where a quantity that grows reaches a target, by few values that take long.

A length of fibre is searched for over the parameter that sets it, a stiffness over the length.
"""

from collections.abc import Callable, Mapping

import numpy as np

_KEPT_AWAY = 0.05
"""Share of a bracket that the next argument is kept away from its ends: a step between them would
stall the search else."""


def around(known: Mapping[float, float], target: float) -> tuple[float | None, float | None]:
    """Find the argument of the largest value up to a target, and that of the next value above."""
    low = [at for at in known if known[at] <= target]
    high = [at for at in known if known[at] > target]
    return (
        max(low, key=lambda at: (known[at], at), default=None),
        min(high, key=lambda at: (known[at], at), default=None),
    )


def interpolated(
    at: tuple[float, float],
    values: tuple[float, float],
    target: float,
    even: bool = False,
    kept_away: float = _KEPT_AWAY,
) -> float:
    """Argument between two where a quantity may reach a target (regula falsi).

    Parameters
    ----------
    at, values : (float, float)
        Two arguments, and the values there, on either side of the target.
    target : float
    even : bool, default False
        Whether the values grow evenly with the argument; else their logarithms do.
    kept_away : float, default 0.05
        Share of the distance of the arguments that the result keeps from both.
    """
    (low, high), (a, b) = at, values
    share = (target - a) / (b - a) if even else np.log(target / a) / np.log(b / a)
    return float(low + np.clip(share, kept_away, 1.0 - kept_away) * (high - low))


def close_in(
    known: dict[float, float],
    measured: Callable[[float], tuple[float, float]],
    first: float,
    following: Callable[[int], float | None],
    wanted: tuple[float, float],
    steps: int,
) -> None:
    """Measure a quantity until a value is within wanted limits, or none can be.

    Parameters
    ----------
    known : dict of argument to value
        Gets what is measured; may hold values already.
    measured : callable
        Takes an argument and returns that which was used in its place, and the value there.
    first : float
        Argument of the first value.
    following : callable
        Takes the number of the step, from 0 on, and returns the next argument; None to end.
    wanted : (float, float)
        Least and largest value that ends the search.
    steps : int
        Values at most.
    """
    least, most = wanted
    at: float | None = first
    for step in range(steps):
        if at is None:
            return
        before = set(known)
        used, value = measured(at)
        if step and used in before:
            return
        known[used] = value
        if any(least <= other <= most for other in known.values()):
            return
        at = following(step)
