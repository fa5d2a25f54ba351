"""Scatter of a stiffness ratio: finite differences, and a hundred prints that differ."""

from dataclasses import replace

import numpy as np
import pytest
from flat_paths import flat_paths

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import Foundation
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.scatter import Scatter, ratio_scatter
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import cut_strands

MODULUS, RHO = 2000.0, 4.0


def cantilever(modulus=MODULUS, bed=False, order=1):
    """A beam that bends in the plane of its layers, 40 x 12 x 4 mm; it may stand on a bed."""
    below = (Foundation("y_min", 5.0, 0.0),) if bed else ()
    return Problem(
        box_mesh((40.0, 12.0, 4.0), (10, 6, 2) if order == 1 else (6, 3, 1)),
        isotropic(modulus, 0.3),
        (Support("x_min"), *below),
        {"bend": (Force("x_max", (0.0, 20.0, 0.0)),)},
        order=order,
    )


def strands(mesh, aside=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), factor=None):
    """Six strands along the beam, at places that may differ, and their stiffness too."""
    ys = np.linspace(1.3, 10.9, 6) + aside
    cut = cut_strands(flat_paths([[[0.2, y, 1.7], [39.9, y, 1.7]] for y in ys]), mesh)
    return cut if factor is None else replace(cut, share=cut.share * factor[cut.path])


def ratio(part, fibres=None, axial=RHO * MODULUS, mode="tension"):
    """Stiffness ratio of a part with strands of EA, N."""
    specimen = part if isinstance(part, Specimen) else Specimen.of(solve(part)["bend"])
    strand = Strand(axial / specimen.modulus)
    fibres = strands(specimen.unreinforced.mesh) if fibres is None else fibres
    return virtual_test(fibres, specimen, strand, mode, ()).ratio


@pytest.mark.parametrize(
    ("bed", "mode"), [(False, "tension"), (False, "partial"), (True, "tension")]
)
def test_sensitivities_are_those_of_finite_differences(bed, mode):
    part = Specimen.of(solve(cantilever(bed=bed))["bend"])
    fibres = strands(part.unreinforced.mesh)
    sensitivity = ratio_scatter(virtual_test(fibres, part, Strand(RHO), mode, ()))
    step, axial = 1e-3, RHO * MODULUS
    by_fibre = [np.log(ratio(part, None, axial * (1 + s), mode)) for s in (step, -step)]
    by_matrix = [
        np.log(ratio(cantilever(MODULUS * (1 + s), bed), mode=mode)) for s in (step, -step)
    ]
    assert sensitivity.fibre == pytest.approx((by_fibre[0] - by_fibre[1]) / (2 * step), rel=1e-4)
    assert sensitivity.matrix == pytest.approx((by_matrix[0] - by_matrix[1]) / (2 * step), rel=1e-4)
    assert (sensitivity.matrix == pytest.approx(-sensitivity.fibre, rel=1e-6)) == (not bed)


def test_a_hundred_solves_scatter_as_the_sensitivities_say():
    """Fifty prints of two designs, each with moduli, strands and places of its own."""
    specimen = Specimen.of(solve(cantilever(order=2))["bend"])
    mesh = specimen.unreinforced.mesh
    given = Scatter(fibre=0.1, matrix=0.06, strands=0.15, position=0.3)
    kept = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0])  # the second design has half of the strands
    all_of, some_of = (
        ratio_scatter(virtual_test(fibres, specimen, Strand(RHO), "tension", ()), given)
        for fibres in (strands(mesh), strands(mesh, factor=kept))
    )
    some = np.random.default_rng(3)
    logs = []
    for _ in range(50):
        fibre, matrix = np.exp(some.normal(size=2) * (given.fibre, given.matrix))
        axial = RHO * MODULUS * fibre / matrix  # no springs: the ratio depends on EA / E alone
        prints = [
            strands(
                mesh,
                some.normal(size=6) * given.position,
                factor * (1.0 + given.strands * some.normal(size=6)),
            )
            for factor in (1.0, kept)
        ]
        logs.append([np.log(ratio(specimen, fibres, axial)) for fibres in prints])
    one, other = np.transpose(logs)
    # The standard deviation of fifty is itself known to 10 %.
    assert np.std(one, ddof=1) == pytest.approx(all_of.deviation, rel=0.2)
    assert np.std(one - other, ddof=1) == pytest.approx(all_of.against(some_of), rel=0.2)


@pytest.mark.parametrize(("key", "value"), [("fibre", -0.1), ("matrix", 1.0), ("position", 9.0)])
def test_scatter_out_of_range_is_refused(key, value):
    with pytest.raises(InputError, match=f"{key} must be"):
        Scatter(**{key: value})
