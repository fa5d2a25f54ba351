import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.colours import palette
from ccfem.comparison.plot.curves import curvature_curves, matching_curves


def curve(figure, name):
    """Points of the one line in the colour of a strategy."""
    colour = palette(["isocurve", "zigzag"])[name]
    (found,) = [line for line in figure.axes[0].lines if line.get_color() == colour]
    return found.get_xdata(), found.get_ydata()


def test_matching_rates_are_drawn_in_percent_beside_chance():
    angles = np.array([30.0, 60.0, 90.0])
    rates = {"isocurve": np.array([0.8, 0.9, 1.0]), "zigzag": np.array([0.2, np.nan, 1.0])}
    figure = matching_curves(rates, angles, "bridge")
    x, y = curve(figure, "isocurve")
    assert x.tolist() == [30, 60, 90]
    assert y == pytest.approx([80, 90, 100])
    chance = figure.axes[0].lines[0]
    assert chance.get_ydata() == pytest.approx(100.0 / 90.0 * np.asarray(chance.get_xdata()))
    names = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert names == ["isocurve", "zigzag"]
    assert png(figure).startswith(b"\x89PNG")
    with pytest.raises(InputError, match="curve 'isocurve' has 3 values for 2 angles"):
        matching_curves(rates, angles[:2])


def test_the_curvature_curve_is_the_share_of_samples_below():
    rng = np.random.default_rng(2)
    samples = np.exp(rng.uniform(np.log(0.02), np.log(2.0), 500))
    figure = curvature_curves({"isocurve": samples, "zigzag": np.zeros(0)}, 3.85)
    x, y = curve(figure, "isocurve")
    for at in (0.015, 0.1, 0.26, 1.0, 3.0):
        drawn = y[np.searchsorted(x, at, side="right") - 1]
        assert drawn == pytest.approx(100.0 * (samples <= at).mean())
    assert png(figure).startswith(b"\x89PNG")
    assert list(figure.axes[0].lines[0].get_xdata()) == pytest.approx([1.0 / 3.85] * 2)
    assert len(curvature_curves({}, 0.0).axes[0].lines) == 0
    with pytest.raises(InputError, match="at least 0 mm; got -1"):
        curvature_curves({}, -1.0)
