"""What fills share: equal sections are prepared once, short paths go, and modes switch."""

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.fem.elasticity.statics import solve
from ccfem.machine.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.planning.infill import Infill, long_enough
from ccfem.paths.planning.layer_plans import in_even_steps
from ccfem.paths.planning.unfolding import may_fold, unfolded_paths
from ccfem.paths.raster.patterns import grid_regions
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.grid import Grid
from ccfem.strategies.mat import Mat
from ccfem.strategies.mps import Mps

MACHINE = Machine(fibre_width=1.6, minimum_length=10.0)


@dataclass(frozen=True)
class Rows(Infill):
    """Two lines across the middle of a section, 30 and 8 mm long; counts what it prepares."""

    spacing: float = 1.0
    minimum_length: float | None = None
    mode: Literal["polyline", "raster"] = "polyline"
    asked: Counter = field(default_factory=Counter, compare=False)

    name: ClassVar[str] = "rows"

    def prepare(self, section, machine):
        self.asked[section] += 1
        return section

    def strands(self, layer, stress, machine, prepared):
        assert shapely.symmetric_difference(prepared, layer.plane.polygon).area < 1e-6
        x, y = shapely.get_coordinates(shapely.centroid(prepared))[0]
        return [np.array([[x - half, y], [x + half, y]]) for half in (15.0, 4.0)]

    def regions(self, image, layer, stress):
        return grid_regions(image.mask, 0.0, 0)


@pytest.fixture(scope="module")
def part():
    case = create_case("open_hole", element_size=4.0)
    (stress,) = solve(case.problem).values()
    return stress, Planar(count=4).cut(case.problem.mesh, case.build)


def test_equal_sections_are_prepared_once(part):
    stress, layers = part
    rows = Rows()
    paths = plan(rows, layers, stress, MACHINE)
    assert paths.layer.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(paths.lengths, 30.0)
    assert list(rows.asked.values()) == [1]
    plan(replace(rows, mode="raster"), layers, stress, MACHINE)
    assert list(rows.asked.values()) == [1]


def test_nothing_is_remembered_from_one_part_to_the_next(part):
    stress, layers = part
    rows = Rows()
    for _ in range(2):
        plan(rows, layers, stress, MACHINE)
    assert list(rows.asked.values()) == [2]


def test_one_layer_is_planned_without_a_part(part):
    alone = Rows(minimum_length=0.0)(part[1][2], None, MACHINE)
    np.testing.assert_allclose(alone.lengths, [30.0, 8.0])


@pytest.mark.parametrize("strategy", [Grid(), Mat(), Mps()], ids=str)
def test_a_part_is_planned_as_its_layers_are(strategy, part):
    """And no thread prepares a geometry that others hold: that crashes."""
    stress, layers = part
    planner = strategy.for_part(stress, layers, MACHINE)
    whole = plan(strategy, layers, stress, MACHINE)
    for layer in layers[:2]:
        alone = strategy(layer, stress_on(layer, stress), MACHINE)
        if may_fold(strategy):
            alone = in_even_steps(alone, MACHINE.fibre_width)
        else:
            alone = in_even_steps(unfolded_paths(alone, layer, MACHINE), MACHINE.fibre_width)
            alone = unfolded_paths(alone, None, MACHINE)
        np.testing.assert_array_equal(whole.on_layer(layer.index).points, alone.points)
    planner(layers[0], stress_on(layers[0], stress), MACHINE)
    held = [x for made in planner.known.values() for x in made if isinstance(x, shapely.Geometry)]
    assert len(held) == (0 if isinstance(strategy, Mat) else 4)
    assert not shapely.is_prepared(held).any()


def test_short_paths_go_by_the_machine_or_by_a_length(part):
    layer = part[1][0]
    lines = [np.array([[0.0, 0.0], [length, 0.0]]) for length in (5.0, 10.0, 20.0)]
    paths = Toolpaths.from_plane(lines, layer)
    assert long_enough(paths, None, MACHINE).lengths.tolist() == [10.0, 20.0]
    assert long_enough(paths, 0.0, MACHINE).lengths.tolist() == [5.0, 10.0, 20.0]
    assert long_enough(paths, 15.0, MACHINE).lengths.tolist() == [20.0]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"spacing": 0.9}, r"rows\.spacing must be at least 1 fibre width; got 0\.9"),
        ({"minimum_length": -1.0}, r"rows\.minimum_length must be at least 0 mm; got -1"),
        ({"mode": "pixels"}, r"rows\.mode must be one of 'polyline', 'raster'; got 'pixels'"),
    ],
)
def test_shared_parameters_are_checked(wrong, message):
    with pytest.raises(InputError, match=message):
        Rows(**wrong)
