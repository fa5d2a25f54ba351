"""What is said of layers that strands do not fill."""

from types import SimpleNamespace

import numpy as np
import shapely

from ccfem.body.meshing import extrude
from ccfem.comparison.remarks import _about_open, open_remarks
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create


def test_layers_that_stay_open_are_named():
    found = SimpleNamespace(
        layers=np.array([0, 3, 5]), values={"coverage": np.array([0.97, 0.9, 0.88, 0.92])}
    )
    assert _about_open(found) == ["12.0% of the section stays without fibre, in layers 3, 5"]
    full = SimpleNamespace(layers=np.array([0]), values={"coverage": np.array([0.94, 0.94])})
    assert _about_open(full) == []


def test_what_is_open_is_named_where_as_much_is_laid_as_can_be():
    """Half of a box 40 x 10 is laid: 20 mm of 1 mm wide strands, 200 mm2 stay open."""
    layer = Planar(count=1).cut(extrude(shapely.box(0, 0, 40, 10), 1.0, 5.0, 1))[0]
    lines = [np.array([[0.0, y], [20.0, y]]) for y in np.arange(10) + 0.5]
    paths = Toolpaths.from_plane(lines, layer)
    evaluation = SimpleNamespace(layers=np.array([0]), values={"coverage": np.array([0.5, 0.5])})
    run = SimpleNamespace(
        name="svt", strategy=create("svt"), toolpaths=paths, evaluation=evaluation
    )
    (line,) = open_remarks([run], [layer], 1.0)
    # But for its corners, (4 - pi) / 4 mm2: no disc of 1 mm reaches into them.
    assert "the largest 199.8 mm2 at (30." in line
    assert "layer 0" in line
    run.strategy = create("svt", {"spacing": 2.0})
    assert open_remarks([run], [layer], 1.0) == []
