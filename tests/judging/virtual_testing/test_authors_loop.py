"""The authors' own paths on their own mesh: ratios that another program found for them."""

import os

import pytest

from ccfem.fem.elasticity.statics import solve
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.judging.virtual_testing.strength import first_failure, matrix_peak

pytestmark = pytest.mark.skipif(
    "CCFEM_CHEN2021" not in os.environ, reason="the authors' data is not here"
)


@pytest.fixture(scope="module")
def benchmark():
    from ccfem.papers.chen_2021 import virtual_test as module

    return module


@pytest.fixture(scope="module")
def loop(benchmark):
    field = solve(benchmark.authors_loop().problem)["pull"]
    strands = {
        name: cut_strands(benchmark.authors_paths(name), field.mesh) for name in ("zigzag", "ours")
    }
    return Specimen.of(field), strands


@pytest.mark.parametrize(
    ("mode", "rho", "published"),
    [("bonded", 2.15, (1.56, 1.88, 1.21)), ("tension", 4.25, (1.67, 2.40, 1.44))],
)
def test_ratios_of_the_authors_paths(benchmark, loop, mode, rho, published):
    assert benchmark.ratios(*loop, rho, mode) == pytest.approx(published, rel=0.02)


def test_the_authors_paths_at_the_default_stiffness(loop):
    specimen, strands = loop
    assert strands["ours"].total == pytest.approx(34660.0, rel=1e-3)
    assert strands["ours"].outside < 1e-6
    tension = virtual_test(strands["ours"], specimen, span=())
    bonded = virtual_test(strands["ours"], specimen, mode="bonded", span=())
    assert tension.ratio == pytest.approx(2.336, rel=0.02)
    assert bonded.ratio == pytest.approx(2.457, rel=0.02)
    assert virtual_test(strands["zigzag"], specimen, Strand(), span=()).ratio == pytest.approx(
        1.636, rel=0.02
    )


def test_first_failure_of_the_authors_parts(benchmark, loop):
    specimen, strands = loop
    strength = benchmark.MATRIX_STRENGTH
    none = strength / matrix_peak(specimen.unreinforced)[0]
    loads = [none]
    for name in ("zigzag", "ours"):
        test = virtual_test(strands[name], specimen, span=())
        loads.append(first_failure(test, matrix_strength=strength).load / 1000.0)
    assert loads == pytest.approx([2.84, 4.59, 5.24], rel=0.02)
