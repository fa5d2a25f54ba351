"""Axes and fronts of values that hardly differ, and best values that look like others."""

import pytest

from ccfem.comparison import ranking
from ccfem.comparison.report import charts
from ccfem.comparison.report.charts import fronts, wide_enough


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([4.73, 4.76], [4.745 - 0.476, 4.745 + 0.476]),
        ([5.0, 5.0], [4.5, 5.5]),
        ([1.0, 3.0], [0.8, 3.2]),
        ([0.0, 0.0], [0.0, 0.0]),
    ],
)
def test_an_axis_is_a_fifth_of_its_largest_value_long(values, ends):
    found = wide_enough(values)
    assert found[0] <= min(values) <= max(values) <= found[1]
    assert found == pytest.approx(ends, abs=1e-12)


class Planned:
    """What a chart reads of a run."""

    printable, evaluation, tested, empty_layers = True, True, None, ()

    def __init__(self, name, **values):
        self.name, self.values = name, values


def drawn(monkeypatch, masses, ratios=(1.2, 1.4, 1.9)):
    monkeypatch.setattr(charts, "headline_values", lambda run: run.values)
    runs = [
        Planned(f"run {k}", fibre_mass=mass, stiffness_ratio_tension=ratio)
        for k, (mass, ratio) in enumerate(zip(masses, ratios, strict=True))
    ]
    (chart,) = fronts(runs, {run.name: "#000" for run in runs})
    return chart


def test_no_front_is_drawn_over_what_hardly_differs(monkeypatch):
    chart = drawn(monkeypatch, (4.73, 4.74, 4.76))
    assert [series["mode"] for series in chart["series"]] == ["markers"] * 3
    assert chart["x_range"] == pytest.approx([4.745 - 0.476, 4.745 + 0.476])
    chart = drawn(monkeypatch, (2.0, 4.0, 6.0))
    assert [series["mode"] for series in chart["series"]] == ["lines"] + ["markers"] * 3
    assert chart["series"][0]["x"] == [2.0, 4.0, 6.0]
    assert chart["x_range"] == pytest.approx([1.6, 6.4])


def test_what_looks_like_another_value_is_not_marked(monkeypatch):
    """0.00001 and 0.00002 are both printed as 0.0%: neither is better to who reads them."""
    heads = ranking.HEADLINE
    head = next(each for each in heads if each.better == "low" and "%" in each.pattern)
    monkeypatch.setattr(ranking, "headline_values", lambda run: run.values)
    monkeypatch.setattr(ranking, "ranking", lambda runs, wanted: tuple(runs))
    monkeypatch.setattr(ranking, "off_length", lambda run, wanted: False)
    monkeypatch.setattr(ranking, "order_of", lambda first, second: None)

    def marked(*values):
        runs = [Planned(f"run {k}", **{head.column: value}) for k, value in enumerate(values)]
        return ranking.best_values(runs, None).get(head.column)

    assert head.pattern.format(1e-5) == head.pattern.format(2e-5)
    assert marked(1e-5, 2e-5, 0.3) is None
    assert marked(1e-5, 1e-5, 0.3) == 1e-5
    assert marked(1e-5, 0.2, 0.3) == 1e-5
