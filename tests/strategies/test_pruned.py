"""Pruning another strategy's fibre: better than planning the same length outright."""

import numpy as np
import pytest

from ccfem.cases import create_case
from ccfem.elasticity import solve
from ccfem.errors import InputError
from ccfem.layers.slicing.planar import Planar
from ccfem.planning import plan
from ccfem.planning.equal_fibre import plan_to_length
from ccfem.strategies import create
from ccfem.strategies.pruned import Pruned
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.virtual_test import virtual_test


@pytest.mark.parametrize("name", ["concentric", "contour_zigzag", "isocurve"])
def test_pruned_fibre_beats_the_same_length_planned_outright(name: str) -> None:
    case = create_case("loop", element_size=4.0)
    field = solve(case.problem)["pull"]
    layers = Planar(count=3).cut(field.mesh, case.build)
    specimen = Specimen.of(field)
    strategy = Pruned(of=name, coverage=0.3, overfill=1.5)
    pruned = plan(strategy, layers, field, case.machine)
    area = sum(float(layer.areas.sum()) for layer in layers)
    length = float(pruned.lengths.sum())
    assert 0.95 * 0.3 * area <= length * case.machine.fibre_width <= 0.3 * area
    assert pruned.lengths.min() >= case.machine.minimum_length
    outright = plan_to_length(
        create(name), layers, field, case.machine, length / len(layers)
    ).toolpaths
    ratios = [virtual_test(paths, specimen, span=()).ratio for paths in (outright, pruned)]
    assert ratios[1] > ratios[0] > 1.0
    assert np.isfinite(pruned.points).all()


@pytest.mark.parametrize(
    "wrong", [{"of": "pruned"}, {"coverage": 0.0}, {"overfill": 0.5}, {"rounds": 0}, {"rho": -1.0}]
)
def test_wrong_parameters_are_refused(wrong: dict) -> None:
    with pytest.raises(InputError, match=f"pruned.{next(iter(wrong))}"):
        create("pruned", wrong)
