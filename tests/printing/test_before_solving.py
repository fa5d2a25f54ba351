"""A print that cannot be made is refused before the part is solved, and named by a check."""

from dataclasses import replace

import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.engine import solved
from ccfem.comparison.front_plans import front_of
from ccfem.comparison.request import Request
from ccfem.comparison.studies import Study
from ccfem.comparison.studies.jobs import jobs_of
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.machine import GcodeProfile, Machine, Process
from ccfem.printing.before_solving import check_print
from ccfem.slicing.slicers import Planar


def part(heights=(1.0, 3.0), height=4.0, **values):
    loads = {"pull": (Force("x_max", (100.0, 0.0, 0.0)),)}
    mesh = box_mesh((100.0, 30.0, height), (10, 3, 2))
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads)
    return Case("part", "Part", problem, slicing=Planar(heights=heights), machine=Machine(**values))


def bed(x, y, z=50.0):
    return {"gcode": GcodeProfile(bed=(x, y, z))}


BROKEN = {
    "bed": (part(**bed(90.0, 200.0)), r"needs 99.2 x 29.2 x 5 mm, but the printer has 90 x 200 "),
    "height": (part(height=9.5, **bed(300.0, 300.0, 10.0)), "the printer has 300 x 300 x 10 mm"),
    # The part fits on 110 mm; the block, 10 mm wide and 4 mm away, and two loops round it do not.
    "beside": (part(**bed(110.0, 200.0)), "with skirt, block, lifts and the offset"),
    "cover": (part((0.06, 3.0)), "below the first fibre layer do not hold it"),
    "top": (part((1.0, 3.99)), "does not fit with a fibre height of 0.1075 mm"),
    "speed": (part(matrix_speed=0.0), "matrix_speed must be above 0"),
    "cutter": (part(cutter_distance=50.0), "raise minimum_length"),
}


@pytest.mark.parametrize(("case", "said"), BROKEN.values(), ids=BROKEN)
def test_it_is_refused_before_the_solve_and_named_by_a_check(case, said):
    with pytest.raises(InputError, match=said):
        Request.of(case, ["zigzag"], print_plans=True)
    Request.of(case, ["zigzag"])  # where no print is asked for it may be planned
    (line,) = ccfem.check(case).not_printable
    with pytest.raises(InputError) as refused:
        Request.of(case, ["zigzag"], print_plans=True)
    assert line == str(refused.value)


def test_what_fits_is_not_refused():
    for case in (part(), part(**bed(150.0, 90.0))):
        Request.of(case, ["zigzag"], print_plans=True)
        assert ccfem.check(case).not_printable == ()
    tight = replace(part(**bed(110.0, 200.0)).machine, process=Process(prime="none", skirt_loops=0))
    mesh = part().problem.mesh
    check_print(mesh, (0.0, 0.0, 1.0), tight, part().known_layers())


LAYERS = {
    "near": (Planar(heights=(1.0, 1.05)), "layers must lie at least 0.1075 mm apart"),
    "outside": (Planar(heights=(1.0, 5.0)), "layer height 5 mm lies outside the part"),
    "high": (Planar(thickness=5.0), "layer thickness must be above 0 and at most the part's"),
    "many": (Planar(count=180), "layers would have about"),
}


@pytest.mark.parametrize(("slicer", "said"), LAYERS.values(), ids=LAYERS)
def test_layers_that_cannot_be_planned_on_are_refused_before_the_solve(slicer, said, monkeypatch):
    """By every command that plans, and in the words of the check."""
    monkeypatch.setattr("ccfem.comparison.engine.solve", None)
    monkeypatch.setattr("ccfem.comparison.studies.work.solve", None)
    monkeypatch.setattr("ccfem.printing.line_counts.MOST_STRANDS", 1e5)
    monkeypatch.setattr("ccfem.cases.case.MOST_STRANDS", 1e5)
    thin = {"fibre_width": 0.05, "fibre_height": 0.01, "filament_area": 1e-4}
    machine = thin if "about" in said else {}
    case = replace(part(**machine), slicing=slicer)
    (line,) = ccfem.check(case).not_planned
    assert said in line
    with pytest.raises(InputError, match=said):
        ccfem.compare(case, ["zigzag"])
    with pytest.raises(InputError, match=f"no slicing could cut 'part': .*{said}"):
        ccfem.compare(case, ["zigzag"], slicings={"a": slicer})
    with pytest.raises(InputError, match=f"part, slicing own: .*{said}"):
        jobs_of(Study((case,), ("zigzag",)))
    with pytest.raises(InputError, match=said):
        front_of(Request.of(case, ["zigzag"]))


def test_numbers_of_layers_of_a_front_are_refused_before_the_solve(monkeypatch):
    monkeypatch.setattr("ccfem.comparison.engine.solve", None)
    request = Request.of(part(), ["zigzag"])
    with pytest.raises(InputError, match="no slicing could cut 'part': 60 layers: layers must"):
        front_of(request, [60])


def test_layers_that_follow_the_stress_are_not_known():
    case = replace(part(), slicing=ccfem.slicing.slicers.create("spatial"))
    assert case.known_layers() == ()


def test_flat_layers_are_cut_once(monkeypatch):
    """For the checks before the solve, to plan on, and for the report: the same layers."""
    case, cuts, cut = part(), [], Planar.cut
    monkeypatch.setattr(Planar, "cut", lambda *about: cuts.append(about) or cut(*about))
    request = Request.of(case, ["zigzag"], print_plans=True)
    layers = solved(request).cut(request.slicings[""].slicer).layers
    assert ccfem.check(case).not_printable == ()
    assert layers is case.known_layers()
    assert len(cuts) == 1
    (lone,) = case.known_layers(Planar(count=1))
    assert lone.plane.height == pytest.approx(2.0)
