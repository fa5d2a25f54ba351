"""Charts of the report: what is good against what it costs, and how values are spread."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.comparison.curve import Curve
from ccfem.comparison.front import FRONTS, Cost, on_front
from ccfem.comparison.headline import headline_values
from ccfem.comparison.ranking import stiffness_ratio
from ccfem.comparison.runs import Run
from ccfem.judging.evaluation.indices.matching import THRESHOLDS, along_fibre, matching_curve
from ccfem.judging.evaluation.layer_paths import pool
from ccfem.judging.virtual_testing.stiffness_test import RESOLUTION

_LEAST, _MOST = 0.01, 10.0
"""Ends, 1/mm, of the scale of curvature; what is straighter counts at its left end."""
_QUANTILES = np.linspace(0.0, 1.0, 101)

_COSTS = {"fibre_mass": Cost("fibre, g")} | {k: FRONTS[k] for k in FRONTS if k != "fibre_length"}
"""Indices that stiffness is drawn over."""

_LEAST_SPAN = 0.2
"""Length of an axis over its largest value, so that what hardly differs looks so."""

_STIFFNESS = "stiffness ratio"


def fronts(runs: Sequence[Run], colours: Mapping[str, str]) -> list[dict[str, Any]]:
    """Charts of stiffness over fibre, time to lay it and first-failure load, with their fronts.

    The front joins the runs that can be printed and that no other such run equals or beats in both;
    it is not drawn where they differ by less than the resolution of the test.
    """
    charts = []
    values = {run.name: headline_values(run) for run in runs}
    for column, (title, factor, better) in _COSTS.items():
        points = [
            (run, factor * values[run.name][column], values[run.name]["stiffness_ratio_tension"])
            for run in runs
            if np.isfinite(values[run.name].get(column, np.nan))
            and "stiffness_ratio_tension" in values[run.name]
        ]
        if len(points) < 2:
            continue
        kept = [(x, y) for run, x, y in points if run.printable]
        series: list[dict[str, Any]] = [
            {
                "name": run.name,
                "colour": colours[run.name],
                "x": [x],
                "y": [y],
                "hollow": [not run.printable],
                "mode": "markers",
            }
            for run, x, y in points
        ]
        line = front(kept, better)
        if all(_spread(values) > RESOLUTION for values in zip(*line, strict=True)):
            joined: dict[str, Any] = {"name": "front", "colour": "#8a94a3", "mode": "lines"}
            ends = {"x": [x for x, _ in line], "y": [y for _, y in line]}
            series.insert(0, {**joined, "legend": False, **ends})
        name = title.split(",")[0]
        charts.append(
            {
                "title": f"Stiffness over {name}",
                "x": title,
                "y": _STIFFNESS,
                "x_range": wide_enough([x for _, x, _ in points]),
                "y_range": wide_enough([y for _, _, y in points]),
                "series": series,
            }
        )
    return charts


def wide_enough(values: Sequence[float]) -> list[float]:
    """Return the ends of an axis, round the values and at least a fifth of the largest apart.

    Examples
    --------
    >>> wide_enough([1.0, 3.0])
    [0.8, 3.2]
    >>> [round(x, 3) for x in wide_enough([4.73, 4.76])]
    [4.269, 5.221]
    """
    low, high = min(values), max(values)
    margin = 0.1 * (high - low)
    lacking = max(0.0, _LEAST_SPAN * max(abs(low), abs(high)) - (high - low) - 2.0 * margin)
    return [low - margin - 0.5 * lacking, high + margin + 0.5 * lacking]


def _spread(values: Sequence[float]) -> float:
    """Largest over smallest value, less 1."""
    return max(values) / min(values) - 1.0 if min(values) > 0.0 else np.inf


def front(points: Sequence[tuple[float, float]], better: str) -> list[tuple[float, float]]:
    """Points that no other one equals or beats in both, by their first number.

    Parameters
    ----------
    points : sequence of (float, float)
    better : {"low", "high"}
        Which first numbers are better; of the second ones, high ones are.
    """
    across, up = np.array(points, dtype=float).reshape(-1, 2).T
    best = on_front(across, up, better)
    return sorted({point for point, chosen in zip(points, best, strict=True) if chosen})


def spreads(
    runs: Sequence[Run], colours: Mapping[str, str], radius: float
) -> Iterator[dict[str, Any]]:
    """Charts of angle, curvature and force along the fibre, all layers together.

    Parameters
    ----------
    runs : sequence of Run
        That did not fail.
    radius : float, mm
        Tightest that the machine allows; 0 for none.
    """
    yield {
        "title": "Fibre along the stress",
        "x": "angle to the stress of larger size, degrees",
        "y": "share of the fibre within it, %",
        "y_range": [0, 101],
        "series": [
            {
                "name": "chance",
                "colour": "#8a94a3",
                "mode": "lines",
                "dash": True,
                "legend": False,
                "x": [0, 90],
                "y": [0, 100],
            },
            *(_line(run, colours, THRESHOLDS, 100.0 * _matching(run)) for run in runs),
        ],
    }
    shares = 100.0 * _QUANTILES
    bends = [(run, _curvatures(run)) for run in runs]
    yield {
        "title": "Curvature",
        "x": "curvature, 1/mm",
        "y": "share of the fibre below it, %",
        "x_log": True,
        "y_range": [0, 101],
        "mark": {"x": 1.0 / radius, "text": f"radius {radius:.3g} mm"} if radius > 0.0 else None,
        "series": [
            _line(run, colours, np.clip(np.quantile(values, _QUANTILES), _LEAST, _MOST), shares)
            for run, values in bends
            if len(values)
        ],
    }
    tested = [run for run in runs if run.tested is not None]
    if tested:
        yield {
            "title": "Force in the fibre",
            "x": "axial force, tension only, N",
            "y": "share of the fibre below it, %",
            "y_range": [0, 101],
            "series": [_line(run, colours, _forces(run), shares) for run in tested],
        }


def _line(run: Run, colours: Mapping[str, str], x: FloatArray, y: FloatArray) -> dict[str, Any]:
    kept = np.isfinite(y)
    return {
        "name": run.name,
        "colour": colours[run.name],
        "mode": "lines",
        "x": np.asarray(x)[kept].tolist(),
        "y": np.asarray(y)[kept].tolist(),
    }


def _matching(run: Run) -> FloatArray:
    """Join the samples of all layers: shares of the fibre within each of `THRESHOLDS`."""
    samples = run.evaluation.samples if run.evaluation is not None else ()
    return matching_curve(along_fibre(pool([sample.alignment for sample in samples])))


def _curvatures(run: Run) -> FloatArray:
    samples = run.evaluation.samples if run.evaluation is not None else ()
    return np.concatenate([np.zeros(0), *(sample.curvature.curvature for sample in samples)])


def _forces(run: Run) -> FloatArray:
    """Force, N, that each share of the fibre's length stays below."""
    assert run.tested is not None
    test = run.tested.bracket.tension
    order = np.argsort(test.axial_force, kind="stable")
    below = np.cumsum(test.strands.length[order])
    if not len(order):
        return np.zeros(len(_QUANTILES))
    at = np.minimum(np.searchsorted(below, _QUANTILES * below[-1]), len(order) - 1)
    return np.asarray(test.axial_force[order][at])


def curve_charts(curve: Curve | None, colours: Mapping[str, str]) -> list[dict[str, Any]]:
    """Chart of stiffness over the length of fibre; none without a curve."""
    if curve is None:
        return []
    series = [
        {
            "name": name,
            "colour": colours[name],
            "mode": "lines+markers",
            "x": [run.length_per_layer for run in runs],
            "y": [stiffness_ratio(run) for run in runs],
            "hollow": [not run.printable for run in runs],
        }
        for name, runs in curve.runs.items()
        if runs
    ]
    return [
        {
            "title": "Stiffness over length of fibre, tension only",
            "x": "fibre, mm a layer",
            "y": _STIFFNESS,
            "marks": list(curve.common),
            "series": series,
        }
    ]
