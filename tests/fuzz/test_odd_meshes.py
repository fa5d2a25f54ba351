"""A few parts of odd shape: seen, or refused in one line. More: benchmarks.fuzz.odd_meshes."""

import re

import numpy as np
import pytest

from benchmarks.fuzz.odd_meshes import PART, see
from benchmarks.fuzz.odd_shapes import odd_grids, odd_shells
from ccfem.base.errors import InputError

EXPECTED = {
    "one tet of size 1e+300": "within 1e.09 mm",
    "one tet of height 0": "flat",
    "a node below the first": "nodes 0 to 3",
    "a tet and itself inside out": "",
    "two tets on one edge": "",
    "box with NaN": "NaN or infinity",
    "Moebius strip, its ends joined": "",
}


@pytest.mark.parametrize("name", EXPECTED)
def test_odd_grids(tmp_path, name):
    points, cells = next(shape[1:] for shape in odd_grids() if shape[0] == name)
    np.savez(tmp_path / "odd.npz", points=points, cells=cells)
    part = tmp_path / "odd.toml"
    part.write_text(PART.format(body='mesh = "odd.npz"'))
    said: tuple[str, ...] = ()
    try:
        see(part)
    except InputError as error:
        said = error.mistakes
    assert not [line for line in said if "\n" in line]
    assert re.search(EXPECTED[name], " ".join(said))


def test_names_are_told_apart():
    names = [shape[0] for shape in (*odd_grids(), *odd_shells())]
    assert len(names) == len(set(names)) >= 120
