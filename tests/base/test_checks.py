"""Checks of parameters: what passes, and what the one line says about what does not."""

import pickle
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

import ccfem
from ccfem.base.checks import KnownNames, check_choices, check_fields, check_known, check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import Zigzag

PLA = isotropic(3500.0, 0.35)


@dataclass(frozen=True)
class WideStrand:
    width: float = 1.0
    least: float | None = None
    most: float | None = 9.0
    end: Literal["round", "flat"] = "round"


@pytest.mark.parametrize(
    ("value", "bounds"),
    [
        (0.0, {"at_least": 0.0}),
        (1.0, {"above": 0.0, "at_most": 1.0}),
        (np.float32(0.5), {"above": 0.0, "below": 1.0}),
        (np.int64(3), {"at_least": 1}),
        (-1e300, {}),
    ],
)
def test_numbers_within_bounds_pass(value, bounds):
    check_number("it", value, **bounds)


@pytest.mark.parametrize(
    ("value", "bounds", "message"),
    [
        (
            -1.0,
            {"at_least": 0.0, "unit": "mm"},
            "at least 0 mm; got -1.0: give one in this range",
        ),
        (
            0.0,
            {"above": 0.0, "at_most": 1.0},
            "above 0 and at most 1; got 0.0: give one in this range",
        ),
        (
            1.0,
            {"above": 0.0, "below": 1.0},
            "above 0 and below 1; got 1.0: give one in this range",
        ),
        (1.5, {"at_most": 1.0}, "at most 1; got 1.5: give one in this range"),
        (
            np.inf,
            {"above": 0.0, "unit": "N"},
            "a finite number, above 0 N; got inf: give one in this range",
        ),
        ("a", {}, "a finite number; got 'a': give a number"),
        (np.nan, {"unit": "degrees"}, "a finite number of degrees; got nan: give a number"),
        ("2", {"at_least": 1}, "a finite number, at least 1; got '2': give one in this range"),
        (
            True,
            {"at_least": 1},
            "a finite number, at least 1; got True: give one in this range",
        ),
        (
            None,
            {"at_least": 1},
            "a finite number, at least 1; got None: give one in this range",
        ),
    ],
)
def test_other_values_are_refused_in_one_line(value, bounds, message):
    with pytest.raises(InputError) as caught:
        check_number("it", value, **bounds)
    assert str(caught.value) == f"it must be {message}"


def test_fields_are_named_by_their_class_and_may_be_left_out():
    check_fields(WideStrand(), "width", "least", above=0.0)
    with pytest.raises(InputError, match=r"^wide_strand\.least must be above 0 mm; got 0"):
        check_fields(WideStrand(least=0.0), "width", "least", above=0.0, unit="mm")
    with pytest.raises(InputError, match=r"wide_strand\.width must be a finite number, .*None"):
        check_fields(WideStrand(width=None), "width", above=0.0)
    check_fields(WideStrand(most=None), "most", above=0.0)


def test_fields_with_choices_hold_one_of_them():
    check_choices(WideStrand(end="flat"))
    message = r"^wide_strand\.end must be one of 'round', 'flat'; got 'pointed': name one of them$"
    with pytest.raises(InputError, match=message):
        check_choices(WideStrand(end="pointed"))


def test_unknown_names_are_answered_by_the_known_ones():
    check_known("road", "a", iter("ab"))
    with pytest.raises(InputError, match=r"^no road named 'c'; there are: a, b \(or walk\)$"):
        check_known("road", "c", ["a", "b"], "or walk")
    with pytest.raises(InputError, match=r"there are: none$"):
        check_known("road", "c", [])


def box_problem():
    loads = {"pull": (Force("x_max", (10.0, 0.0, 0.0)),)}
    return Problem(box_mesh((20.0, 5.0, 5.0), (4, 1, 1)), PLA, (Support("x_min"),), loads)


def test_an_unknown_load_case_names_those_there_are():
    fields = ccfem.solve(box_problem())
    assert list(fields) == ["pull"]
    assert fields.get("bend") is None
    for known in (fields, pickle.loads(pickle.dumps(KnownNames("load case", {"pull": 1})))):
        with pytest.raises(InputError, match=r"^no load case named 'bend'; there are: pull$"):
            known["bend"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"layers": Planar}, "a slicer must be an instance; got the class Planar: write Planar()"),
        ({"layers": 2.5}, "layers must be their number, their heights in mm, or a slicer"),
        ({"layers": "planar:zz"}, "got 'zz'"),
        ({"layers": "no"}, "no slicer named 'no'; there are: "),
        ({"strategies": [Zigzag]}, "a strategy must be an instance; got the class Zigzag: write"),
        ({"strategies": {"z": Zigzag}}, "a strategy must be an instance; got the class Zigzag"),
        ({"strategies": Zigzag}, "strategies must be a list, as ['isocurve', 'zigzag']; got"),
        ({"strategies": "zigzag"}, "got 'zigzag': write it in [ ]"),
        ({"strategies": [3]}, "a strategy must be a name or an object of a dataclass; got 3"),
        ({"slicings": {"flat": Planar}}, "a slicer must be an instance; got the class Planar"),
        ({"slicings": [Planar]}, "a slicer must be an instance; got the class Planar"),
        ({"slicing": Planar()}, "compare has no keyword 'slicing'; it has: case, strategies, la"),
        ({"slicing": Planar()}, ": give it as layers, a slicer or its name"),
        ({"strategy": "zigzag"}, "did you mean 'strategies'?"),
    ],
)
def test_wrong_types_given_to_compare_are_one_line(given, said):
    case = ccfem.Case("box", "Box", box_problem())
    with pytest.raises(InputError) as caught:
        ccfem.compare(case, **{"strategies": ["zigzag"], **given})
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_class_in_place_of_a_strategy_or_slicer_is_refused_by_every_function():
    stress = ccfem.solve(box_problem())["pull"]
    with pytest.raises(InputError, match="got the class Planar"):
        ccfem.slice(stress, Planar)
    layers = ccfem.slice(stress, 2)
    with pytest.raises(InputError, match="got the class Zigzag"):
        ccfem.plan(Zigzag, layers, stress, ccfem.Machine())


@pytest.mark.parametrize(
    "value", [10**400, -(10**4000), float("inf"), np.float32("inf"), float("nan"), True, "2"]
)
def test_what_no_float_holds_is_refused_in_one_line(value):
    with pytest.raises(InputError, match=r"^count must be a finite number, at least 1; got") as no:
        check_number("count", value, at_least=1)
    assert len(str(no.value)) < 140
    check_number("count", 10**300, at_least=1)
