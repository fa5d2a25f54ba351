"""Planning to a wanted length: never more, as near as the strategy's steps allow, and honest."""

import re
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.planning import Amount, plan
from ccfem.paths.planning.equal_fibre import (
    about_shortfall,
    extremes,
    length_per_layer,
    plan_to_length,
    plan_to_lengths,
)
from ccfem.paths.planning.strategy import Planned
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar

LENGTH, WIDTH = 60.0, 40.0
MACHINE = Machine()


@dataclass(frozen=True)
class Lines:
    """``int(WIDTH / spacing)`` lines along the plate: its length changes in steps of a line."""

    spacing: float = 1.0
    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)

    def __call__(self, layer, stress, machine):
        count = int(WIDTH / self.spacing + 1e-9)
        ys = (np.arange(count) + 0.5) * self.spacing
        return Toolpaths.from_plane([np.array([[0.0, y], [LENGTH, y]]) for y in ys], layer)


@dataclass(frozen=True)
class OneLine:
    """One line whose length is a curved function of the parameter and of the layer."""

    share: float = 50.0
    amount: ClassVar[Amount] = Amount("share", most=0.0, least=100.0)

    def __call__(self, layer, stress, machine):
        x = LENGTH * np.sqrt(1.0 - self.share / 100.0) * (0.5 + 0.1 * (layer.index % 3)) + 1e-3
        return Toolpaths.from_plane([np.array([[0.0, 1.0], [x, 1.0]])], layer)


@pytest.fixture(scope="module")
def plate():
    mesh = box_mesh((LENGTH, WIDTH, 4.0), (6, 4, 2))
    problem = Problem(
        mesh, isotropic(3500.0, 0.35), (Support("x_min"),), {"pull": (Force("x_max", (1e3, 0, 0)),)}
    )
    return solve(problem)["pull"], Planar(count=8).cut(mesh)


@pytest.mark.parametrize("wanted", [2400.0, 1730.0, 1000.0, 600.0, 130.0])
def test_steps_of_a_line(plate, wanted):
    """Layers are brought to the wanted mean by one line more on as many as it takes."""
    stress, layers = plate
    planned = plan_to_length(Lines(), layers, stress, MACHINE, wanted)
    whole = int(wanted * len(layers) / LENGTH) * LENGTH / len(layers)
    # What whole lines leave by more than half a per cent, lines that are cut take.
    cut = whole < 0.995 * wanted
    assert planned.length_per_layer == pytest.approx(wanted if cut else whole)
    assert planned.reached
    assert ("strands cut back on 1" in planned.note) == cut
    assert planned.toolpaths.lengths.min() >= MACHINE.minimum_length
    on_each = [len(planned.toolpaths.on_layer(layer.index)) for layer in layers]
    assert max(on_each) - min(on_each) <= 1
    more = on_each.count(max(on_each)) if max(on_each) > min(on_each) else 0
    assert (f"on {more} of 8 layers" in planned.note) == bool(more)


def test_mixed_layers_are_those_of_the_two_values(plate):
    stress, layers = plate
    planned = plan_to_length(Lines(), layers, stress, MACHINE, 1000.0)
    other = float(re.match(r"spacing = (\S+) on", planned.note)[1])
    both = [
        plan(Lines(value), layers, stress, MACHINE) for value in (planned.strategy.spacing, other)
    ]
    matched = 0
    for layer in layers:
        mine, less, more = (
            paths.on_layer(layer.index).points for paths in (planned.toolpaths, *both)
        )
        same = more if len(mine) == len(more) else less
        np.testing.assert_allclose(mine, same, atol=1e-3)
        matched += same is more
    assert f"on {matched} of 8 layers" in planned.note


@pytest.mark.parametrize("count", [2, 3, 5, 8, 11])
def test_layers_that_take_more_are_spread_over_the_stack(plate, count):
    """No gap between them, and none to the ends of the stack, is wider than thrice the mean."""
    stress, _ = plate
    layers = Planar(count=16).cut(stress.mesh)
    wanted = LENGTH * (2.0 + (count + 0.05) / 16.0)
    lines = replace(Lines(), spacing=WIDTH / 2.5)
    planned = plan_to_length(lines, layers, stress, MACHINE, wanted)
    per_layer = np.array([len(planned.toolpaths.on_layer(k)) for k in range(16)])
    more = np.flatnonzero(per_layer == 3)
    assert len(more) == count
    assert np.all((per_layer == 2) | (per_layer == 3))
    assert np.diff([-1, *more, 16]).max() < 3.0 * 17.0 / (count + 1.0)
    assert abs(np.mean(more) - 7.5) < 3.0


@pytest.mark.parametrize("wanted", [30.0, 20.0, 10.0, 3.0, 1.0])
def test_a_length_that_can_be_met_is_met(plate, wanted):
    stress, layers = plate
    planned = plan_to_length(OneLine(), layers, stress, MACHINE, wanted)
    assert 0.99 * wanted <= planned.length_per_layer <= wanted
    assert planned.note == ""
    again = plan(planned.strategy, layers, stress, MACHINE)
    np.testing.assert_array_equal(again.points, planned.toolpaths.points)
    assert length_per_layer(again, layers) == planned.length_per_layer


def test_more_than_the_most_is_said(plate):
    stress, layers = plate
    most = plan_to_length(Lines(), layers, stress, MACHINE, 9000.0)
    assert most.length_per_layer == pytest.approx(40 * LENGTH)
    assert "its most, at spacing = 1" in most.note


def test_where_the_least_is_too_much_that_is_said_and_no_layer_is_empty(plate):
    stress, layers = plate
    least = plan_to_length(Lines(), layers, stress, MACHINE, 61.0)
    assert least.length_per_layer == pytest.approx(2 * LENGTH)
    assert not least.reached
    assert least.note == "lays 120 of 61 mm per layer: its least, at spacing = 20"
    assert len(np.unique(least.toolpaths.layer)) == len(layers)


@dataclass(frozen=True)
class Gappy:
    """Lines as of `Lines`, but none on every third layer where they would be fewer than three."""

    spacing: float = 1.0
    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=20.0)

    def __call__(self, layer, stress, machine):
        paths = Lines(self.spacing)(layer, stress, machine)
        return Toolpaths.empty() if layer.index % 3 == 0 and len(paths) < 3 else paths


@pytest.mark.parametrize("wanted", [155.0, 120.0, 100.0])
def test_no_layer_is_left_empty_that_can_be_filled(plate, wanted):
    stress, layers = plate
    planned = plan_to_length(Gappy(), layers, stress, MACHINE, wanted)
    assert planned.reached
    assert 0.99 * wanted <= planned.length_per_layer <= wanted
    assert len(np.unique(planned.toolpaths.layer)) == len(layers)
    assert planned.toolpaths.lengths.min() >= MACHINE.minimum_length - 1e-9


@dataclass(frozen=True)
class Shelled:
    """`shells` lines that stay, lines in the rest at the spacing, and then `depth` more."""

    spacing: float = 2.0
    shells: int = 6
    depth: float = 0.0
    amount: ClassVar[Amount] = Amount(
        "spacing", most=1.0, least=20.0, beyond=(("shells", 12), ("depth", 10.0))
    )

    def __call__(self, layer, stress, machine):
        count = 2 * self.shells + int((28.0 + self.depth - self.shells) / self.spacing + 1e-9)
        return Toolpaths.from_plane(
            [np.array([[0.0, y], [LENGTH, y]]) for y in 0.5 + np.arange(count)], layer
        )


@pytest.mark.parametrize(
    ("wanted", "own"),
    [
        (800.0, {"shells": 6, "depth": 0.0}),
        (1900.0, {"shells": 6, "depth": 0.0}),
        (2300.0, {"spacing": 1.0, "depth": 0.0}),
        (2700.0, {"spacing": 1.0, "shells": 12}),
    ],
)
def test_further_parameters_follow_one_after_the_other(plate, wanted, own):
    """The infill is thinned first, and shells are added only once it is as dense as can be."""
    stress, layers = plate
    planned = plan_to_length(Shelled(), layers, stress, MACHINE, wanted)
    assert 0.99 * wanted <= planned.length_per_layer <= wanted
    assert {name: getattr(planned.strategy, name) for name in own} == own
    most = plan_to_length(Shelled(), layers, stress, MACHINE, 9000.0)
    assert "its most, at spacing = 1, shells = 12, depth = 10" in most.note
    assert most.length_per_layer == pytest.approx(50 * LENGTH)


def test_several_lengths_share_their_plans_and_grow_with_the_wanted_one(plate):
    stress, layers = plate
    lengths = [130.0, 300.0, 333.0, 700.0, 1100.0, 1730.0, 2399.0]
    found = plan_to_lengths(Lines(), layers, stress, MACHINE, lengths)
    laid = [one.length_per_layer for one in found]
    assert laid == sorted(laid)
    np.testing.assert_allclose(laid, lengths, rtol=0.01)
    least, most = extremes(Lines(), layers, stress, MACHINE)
    assert (least.length_per_layer, most.length_per_layer) == pytest.approx((120.0, 2400.0))


@dataclass(frozen=True)
class Rimmed:
    """Lines of 40 mm in all that no parameter thins, and one of 30 mm over the parameter."""

    spacing: float = 1.0
    amount: ClassVar[Amount] = Amount("spacing", most=1.0, least=200.0)

    def __call__(self, layer, stress, machine):
        x = 30.0 / self.spacing
        return Toolpaths.from_plane(
            [np.array([[0, 1], [40, 1]]), np.array([[0, 2], [x, 2]])], layer
        )


@pytest.mark.parametrize("wanted", [40.5, 41.0, 45.0])
def test_a_length_out_of_proportion_to_the_parameter_is_met(plate, wanted):
    """Guesses by proportion come nowhere near: the least amount itself has to be tried."""
    stress, layers = plate
    planned = plan_to_length(Rimmed(), layers, stress, MACHINE, wanted)
    assert 0.98 * wanted <= planned.length_per_layer <= wanted
    assert len(np.unique(planned.toolpaths.layer)) == len(layers)


@dataclass(frozen=True)
class Counted:
    """One line of a length in proportion to the parameter; counts how often it plans."""

    share: float = 50.0
    amount: ClassVar[Amount] = Amount("share", most=100.0, least=1.0)
    planned: ClassVar[list[int]] = []

    def __call__(self, layer, stress, machine):
        self.planned.append(layer.index)
        x = 0.01 * self.share * LENGTH
        return Toolpaths.from_plane([np.array([[0.0, 1.0], [x, 1.0]])], layer)


def test_a_known_plan_saves_the_search(plate):
    """Where lengths are in proportion one more plan has to do: a strategy may take a minute."""
    stress, layers = plate
    toolpaths = plan(Counted(), layers, stress, MACHINE)
    natural = Planned(Counted(), toolpaths, length_per_layer(toolpaths, layers))
    Counted.planned.clear()
    result = plan_to_length(Counted(), layers, stress, MACHINE, 12.0, start=natural)
    assert 0.99 * 12.0 <= result.length_per_layer <= 12.0
    assert len(Counted.planned) == len(layers)


@dataclass(frozen=True)
class Ragged:
    """One line that jumps in length between 41 and 43 % of the plate, whatever the parameter."""

    share: float = 50.0
    amount: ClassVar[Amount] = Amount("share", most=100.0, least=1.0)
    planned: ClassVar[list[int]] = []

    def __call__(self, layer, stress, machine):
        self.planned.append(layer.index)
        share = self.share if abs(self.share - 42.0) > 1.0 else np.where(self.share < 42, 41, 43)
        return Toolpaths.from_plane([np.array([[0.0, 1.0], [0.01 * share * LENGTH, 1.0]])], layer)


def test_close_plans_on_either_side_are_shared_out_without_a_search(plate):
    """A length that no parameter gives: three plans of the stack, the first one counted."""
    stress, layers = plate
    Ragged.planned.clear()
    toolpaths = plan(Ragged(43.2), layers, stress, MACHINE)
    natural = Planned(Ragged(43.2), toolpaths, length_per_layer(toolpaths, layers))
    wanted = 0.425 * LENGTH
    result = plan_to_length(Ragged(43.2), layers, stress, MACHINE, wanted, start=natural)
    assert 0.99 * wanted <= result.length_per_layer <= wanted
    assert re.match(r"share = \S+ on [1-7] of 8 layers$", result.note)
    assert len(Ragged.planned) <= 3 * len(layers)


@dataclass(frozen=True)
class WholeLines(Lines):
    """Whole lines of 60 mm on each layer, as many as a length holds: it takes the length itself."""

    asked: ClassVar[list[float]] = []

    def natural_length(self, layers, machine):
        return LENGTH * int(WIDTH / self.spacing)

    def for_part(self, stress, layers, machine):
        return self

    def to_lengths(self, stress, layers, machine, lengths):
        self.asked.extend(lengths)
        most = self.natural_length(layers, machine)
        spacings = [WIDTH / max(1, int(min(wanted, most) / LENGTH + 1e-9)) for wanted in lengths]
        return [(replace(self, spacing=spacing),) * 2 for spacing in spacings]


def test_a_longer_plan_is_cut_where_that_to_the_length_lays_less(plate):
    """2,350 of 2,400 mm: 39 whole lines are 2,340, within a hundredth; 590 of 600 are 540."""
    stress, layers = plate
    lengths = [2350.0, 590.0, 1000.0, 2500.0]
    whole, cut, far, most = plan_to_lengths(WholeLines(), layers, stress, MACHINE, lengths)
    assert whole.length_per_layer == pytest.approx(2340.0)
    assert cut.length_per_layer == pytest.approx(590.0)
    assert (whole.reached, whole.note, cut.reached, cut.note) == (True, "", True, "")
    assert cut.toolpaths.lengths.min() >= MACHINE.shortest_strand
    # 1,050 mm hold 17 lines, 1,020 mm: enough for 1,000, which hold 16.
    assert far.length_per_layer == pytest.approx(1000.0)
    assert most.length_per_layer == pytest.approx(2400.0)
    assert most.note == "lays 2400 of 2500 mm per layer: its most"


def test_a_plan_far_below_its_length_is_not_made_again_for_more(plate):
    """2,400 of 2,700 mm are less than nine tenths: a second plan, as long, would lay no more."""
    stress, layers = plate
    WholeLines.asked.clear()
    most = plan_to_length(WholeLines(), layers, stress, MACHINE, 2700.0)
    assert (most.length_per_layer, most.reached) == (pytest.approx(2400.0), False)
    assert WholeLines.asked == [2700.0]


def test_a_length_below_a_strand_is_not_called_the_most(plate):
    """Strands of 60 mm: of 70 mm on a layer one fits, and none of 0.5 mm."""
    _, layers = plate
    shortest = f"the nearest that strands of {MACHINE.shortest_strand:g} mm allow"
    for length, wanted, asked in ((60.0, 70.0, "70"), (0.0, 0.5, "0.5")):
        said = about_shortfall(length, wanted, layers[:1], MACHINE)
        assert said == f"lays {length:.0f} of {asked} mm per layer: {shortest}"


@pytest.mark.parametrize("wanted", [0.0, -5.0, float("nan"), float("inf")])
def test_no_length_is_refused(plate, wanted):
    stress, layers = plate
    with pytest.raises(InputError, match="above 0 mm"):
        plan_to_length(Lines(), layers, stress, MACHINE, wanted)
