"""Radar ("spider") plots: several indices of several strategies on one scale."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.comparison.plot.colours import INK, OUTLINE, palette

_RINGS = (0.25, 0.5, 0.75, 1.0)


def normalised(values: FloatArray, better: str) -> FloatArray:
    """Scores of one index: the best has 1.

    Parameters
    ----------
    values : (k,) array
        All above 0; NaN where an index has no value.
    better : {"low", "high"}
        ``min / x`` where lower is better, ``x / max`` where higher is (Plocher et al. 2022 do not
        say how they scale).

    Returns
    -------
    (k,) array in [0, 1]
        NaN stays.
    """
    if better not in ("low", "high"):
        raise InputError(f"better must be 'low' or 'high'; got '{better}'")
    known = values[np.isfinite(values)]
    least = 0.0 if better == "high" else np.nextafter(0.0, 1.0)
    if len(known) and not known.min() >= least:
        raise InputError(
            f"an index to scale must be {'at least' if better == 'high' else 'above'} 0; got "
            f"{known.min():g}"
        )
    if not len(known):
        return np.array(values)
    if better == "low":
        return np.asarray(known.min() / values)
    return np.asarray(values / known.max()) if known.max() > 0.0 else np.ones_like(values)


def draw_radar(
    axes: Any,
    series: Mapping[str, Sequence[float]],
    indices: Mapping[str, str],
    colours: Mapping[str, str] | None = None,
) -> None:
    """Draw a radar plot of several series on axes of matplotlib.

    Parameters
    ----------
    series : mapping of name to values
        One value an index.
    indices : mapping of title to {"low", "high"}
        Title of each spoke, and which values are better.
    colours : mapping of name to colour, optional
        Default `palette`.
    """
    if len(indices) < 3:
        raise InputError(f"a radar plot needs at least three indices; got {len(indices)}")
    for name, values in series.items():
        if len(values) != len(indices):
            raise InputError(
                f"series '{name}' has {len(values)} values for {len(indices)} indices: give one "
                "each"
            )
    table = np.array([list(values) for values in series.values()], dtype=np.float64)
    scores = np.stack(
        [
            normalised(column, better)
            for column, better in zip(table.T, indices.values(), strict=True)
        ]
    ).T
    spokes = 0.5 * np.pi - 2.0 * np.pi * np.arange(len(indices)) / len(indices)
    ends = np.stack([np.cos(spokes), np.sin(spokes)], axis=1)
    closed = np.concatenate([ends, ends[:1]])
    for ring in _RINGS:
        axes.plot(*(ring * closed).T, color=OUTLINE, lw=0.4, alpha=0.6)
        axes.text(0.02, ring, f"{ring:g}", size=5.5, color=OUTLINE, va="center")
    for end, title in zip(ends, indices, strict=True):
        axes.plot([0.0, end[0]], [0.0, end[1]], color=OUTLINE, lw=0.4, alpha=0.6)
        side = "center" if abs(end[0]) < 0.1 else ("left" if end[0] > 0.0 else "right")
        axes.text(*(1.08 * end), title, size=7.5, ha=side, va="center", color=INK)
    chosen = palette(series) if colours is None else colours
    for name, score in zip(series, scores, strict=True):
        line = np.nan_to_num(score)[:, None] * ends
        axes.plot(*np.concatenate([line, line[:1]]).T, color=chosen[name], lw=1.6, label=name)
        axes.fill(*line.T, color=chosen[name], alpha=0.06)
    axes.set_xlim(-1.15, 1.15)
    axes.set_ylim(-1.15, 1.15)
    axes.set_aspect("equal")
    axes.set_axis_off()
