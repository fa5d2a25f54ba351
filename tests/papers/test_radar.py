"""Radar plots: the scale of every spoke, and what is drawn."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.comparison.plot.canvas import canvas, save
from ccfem.comparison.plot.colours import palette
from ccfem.papers.plocher_2022.figures import draw_radar, normalised


def test_the_best_of_every_index_has_one():
    np.testing.assert_allclose(normalised(np.array([2.0, 4.0, 8.0]), "low"), [1.0, 0.5, 0.25])
    np.testing.assert_allclose(normalised(np.array([2.0, 4.0, 8.0]), "high"), [0.25, 0.5, 1.0])
    found = normalised(np.array([2.0, np.nan, 8.0]), "high")
    np.testing.assert_allclose(found, [0.25, np.nan, 1.0])
    assert np.isnan(normalised(np.full(2, np.nan), "low")).all()
    np.testing.assert_allclose(normalised(np.zeros(2), "high"), 1.0)


def test_values_that_cannot_be_scaled_are_refused():
    with pytest.raises(InputError, match="above 0; got 0"):
        normalised(np.array([0.0, 1.0]), "low")
    with pytest.raises(InputError, match="at least 0; got -1"):
        normalised(np.array([-1.0, 1.0]), "high")


def test_lines_join_the_scores_on_their_spokes(tmp_path):
    spokes = {"energy": "low", "stress": "low", "length": "high", "time": "low"}
    series = {"one": [1.0, 2.0, 3.0, 4.0], "two": [2.0, 2.0, 6.0, 2.0]}
    figure = canvas(5.0, 4.2, dpi=150.0)
    axes = figure.add_subplot()
    draw_radar(axes, series, spokes, palette(series))
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    ends = np.array([[0.0, 1.0], [1.0, 0.0], [0.0, -1.0], [-1.0, 0.0]])
    expected = np.array([1.0, 1.0, 0.5, 0.5])[:, None] * ends
    np.testing.assert_allclose(lines["one"], [*expected, expected[0]], atol=1e-12)
    expected = np.array([0.5, 1.0, 1.0, 1.0])[:, None] * ends
    np.testing.assert_allclose(lines["two"], [*expected, expected[0]], atol=1e-12)
    assert {text.get_text() for text in axes.texts} >= set(spokes)
    save(figure, tmp_path / "radar.png")
    assert (tmp_path / "radar.png").stat().st_size > 5000
