"""mps on the plates of Plocher et al. 2022: filled along the stress, and steady under rounding."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.tensor import strongest_in_plane
from ccfem.judging.evaluation.indices.stiffness_alignment import agreement
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.machine import Machine
from ccfem.papers.plocher_2022.plane_study import bead_area
from ccfem.papers.plocher_2022.plates import plates
from ccfem.slicing.layers.layer import stress_on
from ccfem.strategies.mps import Mps

SHARES = {"I": 95.0, "II": 87.0, "III": 90.0}
"""Agreement, %, that the paper reports of its MPS."""
SHIFT = np.array([17.0 * np.sqrt(2.0), -11.0 * np.pi])


class Laid:
    """Paths of mps on a plate, its points moved before planning and back after."""

    def __init__(self, plate, shift=(0.0, 0.0), noise=0.0):
        (layer, *_), stress = plate.planned_on(1)
        points = layer.points.copy()
        points[:, :2] += shift
        points[:, :2] += noise * np.random.default_rng(0).standard_normal((len(points), 2))
        machine = Machine(fibre_width=plate.bead, minimum_length=0.0)
        moved = replace(layer, points=points, walls=())  # which do not move with the points
        paths = plane_paths(Mps()(moved, stress_on(layer, stress), machine), moved)
        self.length = paths.lengths.sum()
        self.overlap, self.gaps = bead_area(paths, plate.bead)
        self.agreement = 100.0 * self._agreement(paths, plate, np.asarray(shift))

    @staticmethod
    def _agreement(paths, plate, shift):
        """Share of the right angle between the stress of each pixel and the nearest step."""
        steps = np.stack([paths.points[:-1], paths.points[1:]], axis=1)
        steps = np.delete(steps, paths.offsets[1:-1] - 1, axis=0)
        along = np.arctan2(*(steps[:, 1] - steps[:, 0]).T[::-1])
        tree = shapely.STRtree(shapely.linestrings(steps))
        nearest = tree.nearest(shapely.points(plate.mesh.centres + shift))
        _, wanted, defined = strongest_in_plane(plate.isotropic_field.stress)
        return agreement(along[nearest] - wanted)[defined].mean()


@pytest.fixture(scope="module", params=SHARES)
def plate(request):
    return request.param, plates()[request.param]()


@pytest.fixture(scope="module")
def laid(plate):
    return Laid(plate[1])


def test_plates_are_filled_along_the_stress(plate, laid):
    """Ends of beads cut square: what is missing is not hidden by round ends."""
    assert laid.agreement > SHARES[plate[0]]
    assert laid.overlap < 0.016
    assert laid.gaps < 0.02
    # Nothing lies outside: length times width is the section, minus gaps, plus overlap.
    (layer, *_), _ = plate[1].planned_on(1)
    section = replace(layer, walls=()).plane.polygon
    used = laid.length * plate[1].bead / section.area
    assert used == pytest.approx(1.0 + laid.overlap - laid.gaps, abs=1e-4)


# One plate: it takes a second plan, and the others are planned by the same functions.
@pytest.mark.parametrize("plate", ["III"], indirect=True)
def test_rounding_changes_next_to_nothing(plate, laid):
    """Noise of 1e-9 mm and another origin: short strands at junctions may differ, no more."""
    other = Laid(plate[1], shift=SHIFT, noise=1e-9)
    assert other.length == pytest.approx(laid.length, rel=5e-3)
    assert other.agreement == pytest.approx(laid.agreement, abs=0.25)
    assert other.gaps == pytest.approx(laid.gaps, abs=2.5e-3)
