"""Slicers as a family: found by name, made from parameters, chosen by short forms."""

import pytest

from ccfem.base.errors import InputError
from ccfem.slicing.slicers import Planar, as_slicer, create, named


def test_slicers_are_found_by_the_name_of_their_module():
    assert named()["planar"] is Planar


def test_short_forms():
    assert as_slicer(4) == Planar(count=4)
    assert as_slicer([2.0, 1.0]) == Planar(heights=(1.0, 2.0))
    assert as_slicer("planar") == Planar()
    chosen = Planar(thickness=0.4)
    assert as_slicer(chosen) is chosen


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("planer", {}, "no slicer named 'planer'; there are: load_oriented, planar, "),
        ("planar", {"number": 3}, "slicer 'planar' has no parameter 'number'; it has: "),
        ("planar", {"count": "many"}, "slicer planar.count must be a whole number"),
        ("planar", {"count": 0}, "slicer planar: the number of layers must be at least 1"),
    ],
)
def test_wrong_names_and_values_are_one_line(name, parameters, message):
    with pytest.raises(InputError, match=message):
        create(name, parameters)


def test_an_unknown_class_is_no_attribute():
    import ccfem.slicing.slicers

    with pytest.raises(AttributeError, match="Spirral"):
        _ = ccfem.slicing.slicers.Spirral
