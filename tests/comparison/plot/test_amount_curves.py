"""What the legend of a front says."""

import pytest

from ccfem.comparison.plot.curves import AmountPoint, TradePoint, amount_curves, trade_curves


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("printable", [True, False])
def test_hollow_points_are_explained_where_there_are_any(printable):
    amounts = [AmountPoint(1.0, 2.0, True, True), AmountPoint(2.0, 3.0, True, printable)]
    bounds = {"stiffness": [(1.0, 2.5), (2.0, 3.5)]}
    front = amount_curves({"stiffness": {"4 layers": amounts}}, bounds, [1.0])
    assert legend(front)[:2] == ["4 layers", "no paths exceed"]
    trade = trade_curves(
        {"1 m": [TradePoint(2.0, 3.0, 0.0, True), TradePoint(1.9, 3.2, 0.5, printable)]}
    )
    for figure in (front, trade):
        assert ("not printable" in legend(figure)) != printable
