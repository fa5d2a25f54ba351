"""Fibre a known way from the border of its section."""

import numpy as np
import pytest

from ccfem.judging.evaluation.indices.border import indices, sample_border


def border(paths):
    return indices(sample_border(paths), None)


def test_distance_from_the_border(pulled):
    """Two strands of the same length, 2 and 7 mm from the long side of the plate."""
    values = border(pulled.plane([[10, 2], [50, 2]], [[10, 33], [50, 33]]))
    assert values["border_1"] == pytest.approx(2.0)
    assert values["border_50"] == pytest.approx(2.0)
    deep = border(pulled.plane([[20, 20], [40, 20]]))
    assert deep["border_50"] == pytest.approx(20.0)
    assert np.isnan(border(pulled.plane())["border_1"])
