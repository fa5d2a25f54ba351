"""Pruning another strategy's fibre: better than planning the same length outright."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.fem.elasticity import solve
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.paths.planning import plan
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.pruned import Pruned


@pytest.mark.parametrize("name", ["concentric", "contour_zigzag", "isocurve"])
def test_pruned_fibre_beats_the_same_length_planned_outright(name: str) -> None:
    case = create_case("loop", element_size=5.0)
    field = solve(case.problem)["pull"]
    layers = Planar(count=1).cut(field.mesh, case.build)
    specimen = Specimen.of(field)
    # With parameters of its own: without any, plain plans are pruned too, and one may be taken.
    base = {"cap": 60.0} if name == "isocurve" else {}
    strategy = Pruned(of=name, base=base, coverage=0.3, overfill=1.5)
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


def test_the_base_takes_parameters_of_its_own():
    thin = create("pruned", {"of": "zigzag", "base": {"angle": 30.0}})
    assert thin.base == {"angle": 30.0}
    assert hash(thin) == hash(create("pruned", {"of": "zigzag", "base": {"angle": 30.0}}))
    with pytest.raises(InputError, match="strategy 'zigzag' has no parameter 'angel'"):
        create("pruned", {"of": "zigzag", "base": {"angel": 30.0}})
    case = create_case("bar", element_size=5.0)
    field = solve(case.problem)["pull"]
    layers = Planar(count=1).cut(field.mesh, case.build)
    coarse = create("zigzag", {"angle": 0.0, "turn": 0.0})
    along = Pruned(of="zigzag", base={"angle": 0.0, "turn": 0.0}, coverage=0.4)
    paths = plan(along, layers, field, case.machine)
    wanted = along.natural_length(layers, case.machine)
    # The overfill of 1.25, and up to 5 % more.
    whole = plan_to_length(
        coarse, layers, field, case.machine, 1.05 * 1.25 * wanted, tolerance=0.05
    ).toolpaths
    # What is left are stretches of the strands that the strategy with these parameters plans.
    strands = shapely.MultiLineString([path[:, :2] for path in whole])
    assert shapely.dwithin(shapely.points(paths.points[:, :2]), strands, 1e-3).all()
    assert 1.25 * wanted <= whole.lengths.sum() <= 1.05 * 1.25 * wanted
    assert 0.99 * wanted <= paths.lengths.sum() <= wanted * (1.0 + 1e-9)


def test_several_lengths_are_cut_from_one_plan():
    case = create_case("bar", element_size=5.0)
    field = solve(case.problem)["pull"]
    layers = Planar(count=2).cut(field.mesh, case.build)
    full = Pruned(of="zigzag").natural_length(layers, case.machine)
    found = Pruned(of="zigzag").to_lengths(field, layers, case.machine, [full, 0.5 * full])
    for (strategy, planner), length in zip(found, (full, 0.5 * full), strict=True):
        laid = sum(float(planner(layer, None, case.machine).lengths.sum()) for layer in layers)
        assert 0.99 * length <= laid / len(layers) <= length
        again = plan(strategy, layers, field, case.machine)
        assert again.lengths.sum() == pytest.approx(laid, rel=1e-3)
