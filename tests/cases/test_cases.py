import dataclasses
import hashlib
import math
import tomllib

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh.check import check_mesh
from ccfem.cases import Case, create_case, named_cases
from ccfem.cases.bodies import bar_outline, loop_outline
from ccfem.cases.designed import PLATES
from ccfem.cases.part_file import read_part
from ccfem.cases.part_writing import part_text
from ccfem.cases.shipped import shipped_cases
from ccfem.cases.stored import data_folder, manifest, stored_mesh
from ccfem.cases.storing import store
from ccfem.fem.elasticity.statics import solve

NAMES = ("bar", "loop", "open_hole")
SIZES = {
    "loop": (100.0, 140.0, 10.0),
    "bar": (125.0, 25.0, 5.0),
    "open_hole": (200.0, 36.0, 4.0),
}
PLANFORMS = {
    "loop": loop_outline,
    "bar": bar_outline,
    "open_hole": lambda: shapely.box(0, 0, 200, 36) - shapely.Point(100, 18).buffer(6),
}


@pytest.fixture(scope="module", params=NAMES)
def case(request):
    return create_case(request.param)


def mean_on(mesh, facets, nodal):
    """Mean of nodal values over facets, by area."""
    area, _ = mesh.facet_areas(facets)
    return np.einsum("i,i...->...", area, nodal[facets].mean(axis=1)) / area.sum()


def smallest_angle(corners):
    """Smallest angle of any triangle (t, 3, 3), degrees."""
    before = np.roll(corners, 1, axis=1) - corners
    after = np.roll(corners, -1, axis=1) - corners
    cosine = np.einsum("ijk,ijk->ij", before, after)
    cosine /= np.linalg.norm(before, axis=2) * np.linalg.norm(after, axis=2)
    return np.degrees(np.arccos(cosine.max()))


PART_FILES = sorted(path for path in data_folder().glob("*.toml") if path.stem != "manifest")


def test_names():
    """All are those of part files and of optimised plates."""
    assert named_cases().keys() >= {file.stem for file in PART_FILES} | PLATES.keys()
    assert shipped_cases().keys() == {file.stem for file in PART_FILES} | PLATES.keys()
    with pytest.raises(
        InputError, match="no case named 'lop'; there are: arm_bracket, bar, bracket, "
    ):
        create_case("lop")
    with pytest.raises(InputError, match="no parameter 'size'; it has: element_size, order, force"):
        create_case("loop", size=3.0)
    with pytest.raises(InputError, match="order must be one of 'auto', 1, 2; got 3"):
        create_case("bar", order=3)
    with pytest.raises(InputError, match="edge length must be above 0"):
        create_case("bar", element_size=-1.0)


@pytest.mark.parametrize("file", PART_FILES, ids=lambda file: file.stem)
def test_a_shipped_part_file_reads_as_its_case(file):
    """As a user's file, whose mesh lies beside it."""
    part, case = read_part(file), create_case(file.stem)
    assert part.name == file.stem
    assert part.findings == ()
    mine, theirs = part.problem, case.problem
    for name in ("supports", "loads", "order", "combinations", "case_supports"):
        assert getattr(mine, name) == getattr(theirs, name)
    np.testing.assert_equal(mine.material.stiffness, theirs.material.stiffness)
    np.testing.assert_equal(mine.mesh.points, theirs.mesh.points)
    np.testing.assert_equal(mine.mesh.cells, theirs.mesh.cells)
    np.testing.assert_equal(dict(mine.mesh.patches), dict(theirs.mesh.patches))
    assert (part.slicing, part.machine, part.build) == (case.slicing, case.machine, case.build)


def test_a_force_scales_all_loads_of_a_part_file():
    """Vectors by the rule of three."""
    loads = create_case("bracket", force=100.0).problem.loads
    assert [load.vector for load in loads["down"]] == [(0.0, -50.0, 0.0)] * 2
    assert [load.vector for load in loads["side"]] == [(0.0, 0.0, 20.0)] * 2
    back = create_case("two_load_plate", element_size=6.0, force=36.0, both_ways=True)
    vectors = [load.vector for load in back.problem.loads["shear_back"]]
    np.testing.assert_allclose(vectors, [(0, -36, 0), (-120, 0, 0), (120, 0, 0)])


def test_case_is_as_described(case):
    mesh = case.problem.mesh
    assert isinstance(case, Case)
    assert np.allclose(np.ptp(mesh.bounds, axis=0), SIZES[case.name], atol=1e-6)
    assert {"support", "load"} <= set(mesh.patches)
    assert check_mesh(mesh)[1].findings == ()
    outline = PLANFORMS[case.name]()
    thickness = SIZES[case.name][2]
    assert mesh.volumes.sum() == pytest.approx(outline.area * thickness, rel=2e-3)
    floor = mesh.boundary[(mesh.points[mesh.boundary][..., 2] == 0.0).all(axis=1)]
    assert smallest_angle(mesh.points[floor]) > 25.0
    assert len(case.title) < 80
    assert case.source
    assert case.problem.material.source


@pytest.mark.parametrize("name", ["bar", "loop"])
def test_the_stored_meshes_are_those_of_the_manifest(name):
    entry, case = manifest()[name], create_case(name)
    content = (data_folder() / entry["file"]).read_bytes()
    assert hashlib.sha256(content).hexdigest() == entry["sha256"]
    assert len(content) < 1.5e6
    mesh = stored_mesh(name, entry["element_size"])
    assert mesh is not None
    assert np.array_equal(mesh.cells, case.problem.mesh.cells)
    assert stored_mesh(name, 1.01 * entry["element_size"]) is None
    listed = {path.name for path in data_folder().glob("*.npz")}
    assert listed == {entry["file"] for entry in manifest().values()}


def test_the_command_makes_the_stored_mesh_again(tmp_path):
    text = store(tmp_path, ["bar"]).read_text()
    made = tomllib.loads(text)["bar"]
    stored = manifest()["bar"]
    assert {k: v for k, v in made.items() if k != "sha256"} == {
        k: v for k, v in stored.items() if k != "sha256"
    }
    new = np.load(tmp_path / "bar.npz")
    old = np.load(data_folder() / "bar.npz")
    assert sorted(new.files) == sorted(old.files)
    assert np.allclose(new["points"], old["points"], atol=1e-9)
    for name in set(new.files) - {"points"}:
        assert np.array_equal(new[name], old[name])


def test_a_changed_file_is_refused(tmp_path, monkeypatch):
    store(tmp_path, ["bar"])
    monkeypatch.setattr("ccfem.cases.stored.data_folder", lambda: tmp_path)
    size = manifest()["bar"]["element_size"]
    assert stored_mesh("bar", size) is not None
    with (tmp_path / "bar.npz").open("ab") as file:
        file.write(b"more")
    with pytest.raises(InputError, match="SHA-256 differs"):
        stored_mesh("bar", size)
    (tmp_path / "bar.npz").unlink()
    assert stored_mesh("bar", size) is None
    (tmp_path / "manifest.toml").unlink()
    assert manifest() == {}


def test_other_sizes_are_meshed_on_the_fly():
    for name, size in (("loop", 5.0), ("bar", 2.5), ("open_hole", 4.0)):
        case = create_case(name, element_size=size, order=2, force=7.0)
        mesh = case.problem.mesh
        assert mesh.order == 2
        assert np.allclose(np.ptp(mesh.bounds, axis=0), SIZES[name], atol=1e-6)
        assert np.linalg.norm(case.problem.loads["pull"][0].vector) == 7.0


def test_patches_of_the_loop():
    """Outer halves of the holes by arithmetic: half a cylinder of radius 5, 10 high."""
    mesh = create_case("loop").problem.mesh
    for name, sign in (("support", -1.0), ("load", 1.0)):
        area, normal = mesh.facet_areas(mesh.patch(name))
        centre = mesh.points[mesh.patch(name)].mean(axis=1)
        assert area.sum() == pytest.approx(np.pi * 5 * 10, rel=0.06)
        assert (sign * centre[:, 1] > 50.0).all()
        assert np.allclose(np.hypot(centre[:, 0], centre[:, 1] - 50 * sign), 5.0, atol=0.1)
        assert np.abs(normal[:, 2]).max() < 1e-9
    for name in ("hole_bottom", "hole_top"):
        assert mesh.facet_areas(mesh.patch(name))[0].sum() == pytest.approx(100 * np.pi, rel=0.02)


def test_ends_of_bar_and_plate():
    for name in ("bar", "open_hole"):
        mesh = create_case(name).problem.mesh
        width, thickness = SIZES[name][1:]
        for patch in ("support", "load"):
            area = mesh.facet_areas(mesh.patch(patch))[0].sum()
            assert area == pytest.approx(width * thickness)


def test_outline_of_the_loop_by_arithmetic():
    """Without fillets: ring and lugs less the lens they share, less the three holes."""
    ring, lug, gap = 50.0, 20.0, 50.0
    a = np.arccos((gap**2 + lug**2 - ring**2) / (2 * gap * lug))
    b = np.arccos((gap**2 + ring**2 - lug**2) / (2 * gap * ring))
    lens = lug**2 * (a - np.sin(2 * a) / 2) + ring**2 * (b - np.sin(2 * b) / 2)
    area = np.pi * (ring**2 + 2 * lug**2 - 30**2 - 2 * 5**2) - 2 * lens
    assert loop_outline(fillet=1e-3).area == pytest.approx(area, rel=1e-3)
    assert 1.0 < loop_outline().area / area < 1.01
    assert loop_outline().is_valid
    assert shapely.get_num_interior_rings(loop_outline()) == 3


def test_every_case_solves(case):
    problem = case.problem
    field = solve(problem)["pull"]
    mesh = problem.mesh
    force = np.array(problem.loads["pull"][0].vector)
    assert np.allclose(field.reactions.sum(axis=0), -force, atol=1e-5)
    # The work of the load is twice the strain energy (Clapeyron).
    work = force @ mean_on(mesh, mesh.patch("load"), field.displacement)
    assert work == pytest.approx(2 * field.strain_energy, rel=1e-6)


def test_stretch_of_the_bar():
    """Against F / (E A): exactly in the gauge, and as an integral along the whole bar.

    The integral takes the stress as even over each section. It is not in the shoulders, whose
    corners carry nothing: the bar stretches more, by less than a tenth.
    """
    case = create_case("bar", order=2)
    field = solve(case.problem)["pull"]
    mesh = case.problem.mesh
    gauge = np.abs(mesh.points[:, 0]) < 12.0
    slope = np.polyfit(mesh.points[gauge, 0], field.displacement[gauge, 0], 1)[0]
    assert slope == pytest.approx(1000.0 / (3500.0 * 40.0), rel=1e-3)
    middle = np.abs(mesh.points[mesh.corners].mean(axis=1)[:, 0]) < 12.0
    weight = mesh.volumes[middle]
    stress = (weight[:, None, None] * field.stress[middle]).sum(axis=0) / weight.sum()
    assert stress[0, 0] == pytest.approx(1000.0 / 40.0, rel=1e-3)
    assert np.abs(stress - np.diag([stress[0, 0], 0, 0])).max() < 0.02
    x = np.linspace(-62.5, 62.5, 2001)[:-1] + 125 / 4000
    outline = bar_outline()
    width = np.array(
        [outline.intersection(shapely.LineString([(s, -20), (s, 20)])).length for s in x]
    )
    estimate = (1000.0 / (3500.0 * 5.0 * width)).mean() * 125.0
    stretch = mean_on(mesh, mesh.patch("load"), field.displacement)[0]
    assert estimate < stretch < 1.1 * estimate


def test_stress_at_the_hole():
    """Howland's factor for a hole a third of the plate's width, by Heywood's formula.

    On the gross stress 2 + (1 - d/W)^3 over (1 - d/W) is the factor; Heywood, Designing by
    Photoelasticity (1952), good to some per cent. The thickness adds a little in the middle plane.
    """
    case = create_case("open_hole", order=2)
    field = solve(case.problem)["pull"]
    mesh = case.problem.mesh
    ratio = 12.0 / 36.0
    factor = (2 + (1 - ratio) ** 3) / (1 - ratio)
    at_hole = (
        (np.abs(mesh.points[:, 0]) < 0.3)
        & (np.abs(np.abs(mesh.points[:, 1]) - 6.0) < 0.05)
        & (np.abs(mesh.points[:, 2] - 2.0) < 0.1)
    )
    assert at_hole.any()
    peak = field.nodal[at_hole][:, 0, 0].mean()
    assert peak == pytest.approx(factor * 1000.0 / (36.0 * 4.0), rel=0.06)


def test_a_case_is_a_value(case):
    with pytest.raises(dataclasses.FrozenInstanceError):
        case.name = "other"


@pytest.mark.parametrize(
    "odd",
    ["'", '"""', "a\nb", "a.b", "\\", "\t\r\n", "\x00\x7f", "\u2028 \u00e4 \U0001f600", "[x]"],
)  # fmt: skip
def test_text_and_names_of_any_character_are_written_to_a_part_file(odd):
    """Read back by the parser of Python: in values, names of tables, tables in lists, comments."""
    bar = create_case("bar")
    cases = {odd: next(iter(bar.problem.loads.values()))}
    case = dataclasses.replace(
        bar,
        source=odd,
        problem=dataclasses.replace(bar.problem, loads=cases, combinations={}, case_supports={}),
        weights={odd: 0.1 + 0.2},
        parameters={"svt": {odd: [odd, math.inf, 10**400, np.float64(1e-7), np.int64(3)]}},
    )
    part = tomllib.loads(part_text(case, odd, comment=f"{odd}\n\ud800"))
    assert (part["source"], part["mesh"]) == (odd, odd)
    assert [load["patch"] for load in part["loads"][odd]] == [load.patch for load in cases[odd]]
    assert part["weights"] == {odd: 0.1 + 0.2}  # to the last digit
    assert part["strategies"]["svt"][odd] == [odd, math.inf, 10**400, 1e-7, 3]
    assert type(part["strategies"]["svt"][odd][-1]) is int


def test_half_a_character_is_refused_in_a_part_file():
    case = dataclasses.replace(create_case("bar"), source="cut \ud800 short")
    with pytest.raises(InputError, match=r"must be Unicode; got '\\ud800 short.*: rename"):
        part_text(case, "bar.npz")
