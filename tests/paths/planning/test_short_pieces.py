import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.machine import Machine
from ccfem.paths.planning.infill import about_short_pieces, short_share
from ccfem.slicing.slicers.planar import Planar


def test_a_bar_is_short_of_room_where_it_is_shorter_than_the_least_path():
    # Strands keep half a width off both ends: 29 mm of a bar of 30 mm.
    layers = Planar(count=2).cut(box_mesh((30.0, 10.0, 4.0), (3, 2, 2)))
    assert short_share(layers, Machine(minimum_length=28.9)) == 0.0
    assert about_short_pieces(layers, Machine(minimum_length=28.9)) == ""
    machine = Machine(minimum_length=29.1)
    # All of it but the corners that a round strand does not reach.
    assert short_share(layers, machine) == pytest.approx(1.0 - (4.0 - 3.1416) * 0.25 / 300.0, 1e-3)
    assert about_short_pieces(layers, machine).startswith("; 100% of the section lies in pieces")
