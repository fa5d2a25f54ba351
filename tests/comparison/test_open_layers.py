"""What is said of layers that strands do not fill."""

from types import SimpleNamespace

import numpy as np

from ccfem.comparison.remarks import _about_open


def test_layers_that_stay_open_are_named():
    found = SimpleNamespace(
        layers=np.array([0, 3, 5]), values={"coverage": np.array([0.97, 0.9, 0.88, 0.92])}
    )
    assert _about_open(found) == ["12.0% of the section stays without fibre, in layers 3, 5"]
    full = SimpleNamespace(layers=np.array([0]), values={"coverage": np.array([0.94, 0.94])})
    assert _about_open(full) == []
