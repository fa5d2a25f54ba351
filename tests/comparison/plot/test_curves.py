import numpy as np

from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.colours import palette
from ccfem.comparison.plot.curves import StiffnessPoint, stiffness_curves


def test_stiffness_is_drawn_over_length_and_what_cannot_be_printed_is_hollow():
    points = {
        "isocurve": [StiffnessPoint(100.0, 1.5, True), StiffnessPoint(200.0, 2.0, False)],
        "zigzag": [StiffnessPoint(100.0, 1.1, True)],
    }
    figure = stiffness_curves(points, marked=(100.0,), heading="bridge")
    (axes,) = figure.axes
    colour = palette(points)["isocurve"]
    curve, *marks = [line for line in axes.lines if line.get_color() == colour]
    assert curve.get_xydata().tolist() == [[100.0, 1.5], [200.0, 2.0]]
    assert [mark.get_markerfacecolor() for mark in marks] == [colour, "white"]
    assert list(axes.lines[0].get_xdata()) == [100.0, 100.0]
    assert np.isclose(axes.get_ylim(), (1.0, 2.08)).all()
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["isocurve", "zigzag"]
    assert png(figure).startswith(b"\x89PNG")
