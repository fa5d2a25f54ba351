"""Stress of other programs: what comes in is what was written, and nothing else is taken for it."""

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
import pyvista

from benchmarks.fuzz.mutants import frd
from ccfem.base.errors import InputError
from ccfem.base.tensor import to_voigt
from ccfem.body.files import read_mesh
from ccfem.body.files.formats import vtu
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison import compare
from ccfem.comparison.request import ForeignStress
from ccfem.fem.elasticity import Force, GivenStress, Problem, Support, solve
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.materials import isotropic
from ccfem.fem.stress_files import read_stress
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.printing.export.vtk import write_result
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

LOADS = {"pull": (Force("x_max", (300.0, 40.0, 20.0)),)}


def part(order=1, size=(60.0, 24.0, 4.0), divisions=(20, 8, 2)):
    held = (Support("x_min"),)
    return Problem(box_mesh(size, divisions), isotropic(3500.0, 0.35), held, LOADS, order=order)


@pytest.fixture(scope="module", params=[1, 2])
def field(request):
    return solve(part(request.param))["pull"]


@pytest.fixture
def written(field, tmp_path):
    write_result(field, tmp_path / "result.vtu")
    return tmp_path / "result.vtu"


def test_paths_on_what_was_written_and_read_are_the_same(field, written):
    given = read_stress(written, field.mesh, held_or_loaded=field.held_or_loaded)
    np.testing.assert_array_equal(given.stress, field.stress)
    np.testing.assert_array_equal(given.nodal, field.nodal)
    machine = Machine(minimum_length=20.0)
    for name in ("isocurve", "zigzag"):
        one, other = (
            plan(create(name), Planar(count=2).cut(field.mesh), stress, machine)
            for stress in (field, given)
        )
        assert len(one)
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.offsets, other.offsets)


def test_a_result_holds_all_that_it_promises(field, written):
    grid = pyvista.read(written)
    np.testing.assert_array_equal(grid.point_data["displacement"], field.displacement)
    np.testing.assert_array_equal(grid.point_data["reaction"], field.reactions)
    np.testing.assert_array_equal(
        grid.cell_data["error"], field.error.densities(field.mesh.volumes)
    )
    strain = grid.cell_data["strain"]  # tensors: xx, yy, zz, xy, yz, xz
    np.testing.assert_array_equal(strain[:, 3], field.strain[:, 0, 1])
    np.testing.assert_array_equal(grid.cell_data["stress"][:, 4], field.stress[:, 1, 2])
    values = grid.cell_data["principal_stress"]
    axes = np.stack([grid.cell_data[f"principal_direction_{k}"] for k in (1, 2, 3)], axis=2)
    again = np.einsum("mik,mk,mjk->mij", axes, values, axes)
    np.testing.assert_allclose(again, field.stress, atol=1e-9 * np.abs(field.stress).max())
    text = {name: bytes(grid.field_data[name]).decode() for name in ("load case", "unit of stress")}
    assert text == {"load case": "pull", "unit of stress": "MPa"}
    mesh = read_mesh(written)
    assert set(mesh.patches) == set(field.mesh.patches)
    assert mesh.order == field.mesh.order


def test_meshio_reads_the_same_result(field, written):
    theirs, ours = meshio.read(written), pyvista.read(written)
    assert [block.type for block in theirs.cells] == [
        "tetra" if field.mesh.order == 1 else "tetra10"
    ]
    np.testing.assert_array_equal(theirs.points, field.mesh.points)
    np.testing.assert_array_equal(theirs.cells[0].data, field.mesh.cells)
    assert set(theirs.point_data) == set(ours.point_data.keys())
    for name, values in theirs.point_data.items():
        np.testing.assert_array_equal(values, ours.point_data[name])
    assert set(theirs.cell_data) == set(ours.cell_data.keys())
    for name, (values,) in theirs.cell_data.items():
        np.testing.assert_array_equal(values, ours.cell_data[name])
    np.testing.assert_array_equal(theirs.cell_data["stress"][0][:, 4], field.stress[:, 1, 2])
    for name, facets in field.mesh.patches.items():
        np.testing.assert_array_equal(theirs.field_data[f"patch:{name}"], facets)
    assert bytes(theirs.field_data["unit of stress"]) == b"MPa"


def test_a_node_that_is_nowhere_is_one_line(field, written):
    grid = pyvista.read(written)
    grid.points[3, 1] = np.nan
    grid.save(written)
    with pytest.raises(InputError, match="nodes must be finite; got NaN or infinity"):
        read_stress(written, field.mesh, "MPa")


def test_a_unit_as_a_string_is_read_too(field, written):
    """As ccfem wrote it before, and as other programs may."""
    grid = pyvista.read(written)
    grid.field_data["unit of stress"] = ["Pa"]
    grid.save(written)
    given = read_stress(written, field.mesh)
    np.testing.assert_allclose(given.stress, 1e-6 * field.stress, rtol=1e-15)


def test_other_numbers_of_nodes_and_cells_are_mapped(field, tmp_path):
    mesh, random = field.mesh, np.random.default_rng(4)
    order, cells = random.permutation(len(mesh.points)), random.permutation(len(mesh.cells))
    number = np.argsort(order)
    points = np.array(mesh.points[order])
    shuffled = TetMesh(points, number[mesh.cells][cells])
    write_result(
        replace(
            field,
            problem=replace(
                field.problem,
                mesh=shuffled.with_patches(
                    {name: number[facets] for name, facets in mesh.patches.items()}
                ),
            ),
            displacement=field.displacement[order],
            stress=field.stress[cells],
            nodal=field.nodal[order],
            reactions=field.reactions[order],
        ),
        tmp_path / "shuffled.vtu",
    )
    given = read_stress(tmp_path / "shuffled.vtu", mesh)
    np.testing.assert_array_equal(given.stress, field.stress)
    np.testing.assert_array_equal(given.nodal, field.nodal)


def test_arrays_of_other_programs(field, tmp_path):
    mesh = field.mesh
    grid = pyvista.UnstructuredGrid(
        {10 if mesh.order == 1 else 24: mesh.cells}, np.array(mesh.points)
    )
    grid.cell_data["S"] = 1e6 * field.stress.reshape(-1, 9)
    grid.save(tmp_path / "full.vtu")
    for array, said in (("S", ""), (None, "of full.vtu the array S is taken")):
        given = read_stress(tmp_path / "full.vtu", mesh, "Pa", array)
        np.testing.assert_allclose(given.stress, field.stress, rtol=1e-12, atol=1e-12)
        assert given.assumed.replace("'", "") == said
    with pytest.raises(InputError, match="does not say the unit of its stress"):
        read_stress(tmp_path / "full.vtu", mesh, array="S")
    with pytest.raises(InputError, match=r"no array 'T'; there are: S: .* --stress-array"):
        read_stress(tmp_path / "full.vtu", mesh, "MPa", "T")
    with pytest.raises(InputError, match="unit of stress must be"):
        read_stress(tmp_path / "full.vtu", mesh, "psi", "S")
    grid.cell_data["S"] = np.ones((len(mesh.cells), 6))
    grid.save(tmp_path / "unnamed.vtu")
    with pytest.raises(InputError, match="six components without names: give their order"):
        read_stress(tmp_path / "unnamed.vtu", mesh, "MPa", "S")
    with pytest.raises(InputError, match="must name the components xx, yy"):
        read_stress(tmp_path / "unnamed.vtu", mesh, "MPa", "S", components="xx,yy,zz,xy,yz")
    grid.cell_data["sigma"] = grid.cell_data["S"]
    grid.save(tmp_path / "two.vtu")
    with pytest.raises(InputError, match="several arrays like 'stress'; there are: S, sigma: name"):
        read_stress(tmp_path / "two.vtu", mesh, "MPa")


IN_VTK = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}


def legacy(path, mesh, data):
    """Write a legacy VTK file as text: scalars, and arrays of six without names."""
    kind, corners = (10, 4) if mesh.order == 1 else (24, 10)
    lines = ["# vtk DataFile Version 3.0", "results", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {len(mesh.points)} double", *(" ".join(map(repr, map(float, p)))
              for p in mesh.points)]  # fmt: skip
    lines.append(f"CELLS {len(mesh.cells)} {(corners + 1) * len(mesh.cells)}")
    lines += [f"{corners} {' '.join(map(str, nodes))}" for nodes in mesh.cells]
    lines += [f"CELL_TYPES {len(mesh.cells)}", *[str(kind)] * len(mesh.cells)]
    lines += [f"POINT_DATA {len(mesh.points)}", f"FIELD FieldData {len(data)}"]
    for name, values in data.items():
        rows = np.asarray(values).reshape(len(mesh.points), -1)
        lines.append(f"{name.replace(' ', '%20')} {rows.shape[1]} {len(rows)} double")
        lines += [" ".join(map(repr, map(float, row))) for row in rows]
    path.write_text("\n".join(lines) + "\n")


def test_six_components_without_names_in_a_legacy_file(field, tmp_path):
    # As ccx2paraview converts them: S of CalculiX in its order xx, yy, zz, xy, yz, zx.
    path, nodal = tmp_path / "part.vtk", field.nodal
    legacy(path, field.mesh, {"S": np.stack([nodal[:, i, j] for i, j in IN_VTK.values()], axis=1)})
    given = read_stress(path, field.mesh, "MPa", components="xx, yy, zz, xy, yz, zx")
    np.testing.assert_array_equal(given.nodal, nodal)
    mesh = read_mesh(path, check=False)
    np.testing.assert_array_equal(mesh.cells, field.mesh.cells)
    np.testing.assert_array_equal(mesh.points, field.mesh.points)
    path.write_text("# vtk DataFile Version 3.0\nresults\nASCII\nDATASET POLYDATA\n")
    with pytest.raises(InputError, match="and have DATASET UNSTRUCTURED_GRID"):
        read_mesh(path)


@pytest.mark.parametrize("suffix", [".vtk", ".vtu"])
def test_results_of_freecad_are_in_pascal_and_a_component_each(field, tmp_path, suffix):
    # Their names and the factor 10^6: FemVTKTools.cpp of FreeCAD 1.0.
    path, mesh = tmp_path / f"part{suffix}", field.mesh
    data = {f"Stress {c} component": 1e6 * field.nodal[:, i, j] for c, (i, j) in IN_VTK.items()}
    data |= {"Strain xx component": 0.0 * data["Stress xx component"], "von Mises Stress": data[
        "Stress xx component"]}  # fmt: skip
    if suffix == ".vtk":
        legacy(path, mesh, data)
    else:
        grid = pyvista.UnstructuredGrid({10 if mesh.order == 1 else 24: mesh.cells}, mesh.points)
        grid.point_data.update(data)
        grid.save(path)
    given = read_stress(path, mesh)
    np.testing.assert_allclose(given.nodal, field.nodal, rtol=1e-12, atol=1e-12)
    assert given.assumed == f"the stress of {path.name} is taken for Pa, as FreeCAD writes it"
    given = read_stress(path, mesh, "kPa")
    np.testing.assert_allclose(given.nodal, 1e3 * field.nodal, rtol=1e-12, atol=1e-9)
    assert given.assumed == ""


@pytest.mark.filterwarnings("error")
def test_numbers_that_overflow_are_one_line(field, tmp_path):
    path = tmp_path / "far.vtu"
    good = field.stress.reshape(-1, 9)
    bad = good.copy()
    bad[3, 1] = bad[3, 3] = 1.7e308
    cells = [("tetra", field.mesh.cells[:, :4])]
    for factor, stress, said in ((1.0, bad, "of element 3"), (1e300, good, "has no node where")):
        values = {"stress": [stress]}
        meshio.Mesh(factor * field.mesh.points, cells, cell_data=values).write(path)
        with pytest.raises(InputError, match=said):
            read_stress(path, field.mesh, "MPa")


def test_stress_on_another_mesh_is_refused(written, field):
    size = (60.0, 24.0, 4.0)
    other = box_mesh(size, (10, 4, 1))
    with pytest.raises(InputError, match="has other cells than the part"):
        read_stress(written, other)
    with pytest.raises(InputError, match=r"has no node where .* corners of the part lie"):
        read_stress(written, box_mesh((61.0, 24.0, 4.0), (20, 8, 2)))
    with pytest.raises(InputError, match="holds stress in MPa; got the unit Pa"):
        read_stress(written, field.mesh, "Pa")
    with pytest.raises(InputError, match=r"read from \.vtu, \.vtk, \.xdmf, \.frd or"):
        read_stress(written.rename(written.with_suffix(".odb")), field.mesh)


def table(kind, stress, first=1, unit=" [MPa]", order=None):
    """CSV of a table of stress (k, 3, 3)."""
    lines = [f"{kind};S11{unit};S22{unit};S33{unit};S12{unit};S13{unit};S23{unit};note"]
    for k in range(len(stress)) if order is None else order:
        s = stress[k]
        parts = (s[0, 0], s[1, 1], s[2, 2], s[0, 1], s[0, 2], s[1, 2])
        lines.append(";".join([str(k + first), *map(repr, map(float, parts)), "-"]))
    return "\n".join(lines)


def test_tables_by_element_and_by_node(field, tmp_path):
    path, mesh = tmp_path / "stress.csv", field.mesh
    order = np.random.default_rng(1).permutation(len(mesh.cells))
    path.write_text(table("Element", field.stress, 1, order=order))
    given = read_stress(path, mesh)
    np.testing.assert_array_equal(given.stress, field.stress)
    if mesh.order == 1:  # averaged as the solve does
        np.testing.assert_allclose(given.nodal, field.nodal, atol=1e-9)
    path.write_text(table("node", 1e6 * field.nodal, 0, " [Pa]"))
    given = read_stress(path, mesh)
    np.testing.assert_allclose(given.nodal, field.nodal, rtol=1e-12, atol=1e-12)
    means = field.nodal[mesh.corners].mean(axis=1)
    np.testing.assert_allclose(given.stress, means, rtol=1e-9, atol=1e-9)
    path.write_text(table("node", field.nodal[:-3]))
    with pytest.raises(InputError, match="and the part"):
        read_stress(path, mesh)
    path.write_text(table("element", field.stress, 7))
    with pytest.raises(InputError, match="expected every element from 0 or from 1 on"):
        read_stress(path, mesh)
    path.write_text(table("element", field.stress).replace("S13", "S14"))
    with pytest.raises(InputError, match="must name the components"):
        read_stress(path, mesh)
    path.write_text(table("element", field.stress, unit=""))
    with pytest.raises(InputError, match="does not say the unit"):
        read_stress(path, mesh)
    path.write_text(table("element", field.stress).replace("S13 [MPa]", "S13 [Pa]"))
    with pytest.raises(InputError, match="give them one"):
        read_stress(path, mesh)
    path.write_text(table("element", field.stress) + "\n5;1;2;x;4;5;6")
    with pytest.raises(InputError, match=rf"line {len(mesh.cells) + 2}: expected .* '5;1;2;x;4"):
        read_stress(path, mesh)
    path.write_text("node,Sxx\n1," + "1" * 200_000)
    with pytest.raises(InputError, match="field larger than field limit"):
        read_stress(path, mesh)


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (-1e300, "MPa", r"got -1e\+300 MPa as xz of element 8: correct it, or the unit of all"),
        (2e7, "MPa", r"within 1e\+07 MPa; got 2e\+07 MPa as xz of element 8"),
        (1e306, "GPa", r"got 1e\+306 GPa as xz of element 8"),
        (np.nan, "MPa", "must be finite and .*; got nan MPa as xz of element 8"),
        (-np.inf, "Pa", "got -inf Pa as xz of element 8"),
        (2e7, "Pa", ""),
    ],
)
def test_stress_that_no_solid_has_is_refused(tmp_path, value, unit, said):
    mesh, path = box_mesh((6.0, 3.0, 2.0), (2, 1, 1)), tmp_path / "stress.csv"
    stress = np.ones((len(mesh.cells), 3, 3))
    stress[7, 0, 2] = stress[7, 2, 0] = value
    path.write_text(table("element", stress, 1, f" [{unit}]"))
    if not said:
        assert read_stress(path, mesh).stress[7, 0, 2] == pytest.approx(20.0)
        return
    with pytest.raises(InputError, match=said):
        read_stress(path, mesh)
    with pytest.raises(InputError, match=r"at stress\[7, 0, 2\]: correct it, or its unit"):
        GivenStress(mesh, 1e3 * stress, np.ones((len(mesh.points), 3, 3)))


def calculix(problem: Problem, folder: Path) -> Path:
    """Solve a problem with CalculiX on the same mesh; the result file."""
    mesh = problem.mesh
    forces = sum(nodal_forces(mesh, load) for load in problem.loads["pull"])
    held = np.unique(mesh.facet_nodes(mesh.patch("x_min"))) + 1
    modulus, poisson = 3500.0, 0.35
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{k}, {x:.12e}, {y:.12e}, {z:.12e}" for k, (x, y, z) in enumerate(mesh.points, 1)]
    lines.append(f"*ELEMENT, TYPE=C3D{4 if mesh.order == 1 else 10}, ELSET=E")
    lines += [f"{k}, {', '.join(map(str, c + 1))}" for k, c in enumerate(mesh.cells, 1)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{modulus}, {poisson}"]
    lines += ["*SOLID SECTION, ELSET=E, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{k}, 1, 3" for k in held]
    lines += ["*STEP", "*STATIC", "*CLOAD"]
    lines += [
        f"{node + 1}, {i + 1}, {forces[node, i]:.12e}"
        for node, i in zip(*np.nonzero(forces), strict=True)
    ]
    lines += ["*NODE FILE", "U", "*EL FILE", "S", "*END STEP", ""]
    (folder / "part.inp").write_text("\n".join(lines))
    subprocess.run(["ccx", "part"], cwd=folder, check=True, capture_output=True, timeout=300)
    return folder / "part.frd"


@pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed")
def test_a_comparison_on_stress_of_calculix_is_that_on_ours(tmp_path):
    # Quadratic cells of one volume, so that both programs average alike at the nodes; the file has
    # six digits. Ours goes the same way, through the nodes alone.
    problem = part(2, divisions=(10, 4, 1))
    field = solve(problem)["pull"]
    given = read_stress(calculix(field.problem, tmp_path), field.mesh, "MPa")
    size = np.abs(field.nodal).max()
    np.testing.assert_allclose(given.nodal, field.nodal, atol=2e-5 * size)
    (tmp_path / "ours.csv").write_text(table("node", field.nodal))
    case = Case("strip", "", problem, slicing=Planar(count=2), machine=Machine(minimum_length=20.0))
    files = (ForeignStress(tmp_path / "part.frd", "MPa"), ForeignStress(tmp_path / "ours.csv"))
    theirs, ours = (
        compare(case, ("isocurve", "zigzag"), natural=True, stress=file) for file in files
    )
    for one, other in zip(theirs.runs, ours.runs, strict=True):
        assert not one.failure
        assert one.length_per_layer == pytest.approx(other.length_per_layer, rel=1e-4)
        for name in ("efficiency", "fibre_length"):
            found = one.evaluation.total[name], other.evaluation.total[name]
            assert found[0] == pytest.approx(found[1], rel=1e-4)
        tested = one.tested.bracket.tension.ratio, other.tested.bracket.tension.ratio
        assert tested[0] == pytest.approx(tested[1], rel=1e-4)


@pytest.fixture
def results():
    """Text of a result file of CalculiX, its mesh, and the stress in it (n, 6), Voigt."""
    mesh = box_mesh((6.0, 3.0, 2.0), (2, 1, 1))
    stress = np.random.default_rng(2).normal(size=(len(mesh.points), 6)).round(5)
    return frd(mesh, stress[:, [0, 1, 2, 5, 3, 4]]), mesh, stress


def test_results_of_calculix_are_in_mpa_as_the_mesh_is_in_mm(tmp_path, results):
    text, mesh, stress = results
    path = tmp_path / "part.frd"
    path.write_text(text)
    given = read_stress(path, mesh)
    np.testing.assert_allclose(to_voigt(given.nodal), stress, rtol=1e-5)
    assert given.assumed == "the stress of part.frd is taken for MPa, as its nodes are in mm"
    given = read_stress(path, mesh, "kPa")
    np.testing.assert_allclose(to_voigt(given.nodal), 1e-3 * stress, rtol=1e-5)
    assert given.assumed == ""


def test_a_node_of_a_large_number_takes_no_memory(tmp_path, results):
    text, mesh, stress = results
    text = text.replace(f" -1{1:10d}", " -19999999999")  # nodes and stress, and an element
    text = re.sub(rf"^( -2.*?){1:10d}", r"\g<1>9999999999", text, flags=re.M)
    (tmp_path / "part.frd").write_text(text)
    given = read_stress(tmp_path / "part.frd", mesh)
    np.testing.assert_allclose(to_voigt(given.nodal), stress, rtol=1e-5)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r"^( -2 .*).{10}$", r"\1", "element 1 has 3 nodes in place of 4"),
        (r"^( -2 .*)1$", r"\g<1>1\n -2         1", "element 1 has 5 nodes in place of 4"),
        (r"^( -2.{30}).{10}$", r"\g<1>9999999999", "names node 9999999999, which the block 2C"),
        (r"^( -1.{34}).{12}$", r"\1", "the block 2C is not as CalculiX writes it"),
        (r"^( -1.{70}).*$", r"\1", "the block STRESS is not as CalculiX writes it"),
        (r"^( -1.{10}).{12}", r"\1         nan", "nan .* is not finite"),
        (r"^ -4.*$", " -4", "has no stress: ask ccx"),
        (r"(?s)\n -3\n 9999.*", "", "is cut off in its block STRESS: copy it again"),
    ],
)
def test_spoiled_results_are_one_line(tmp_path, results, old, new, said):
    text, count = re.subn(old, new, results[0], count=1, flags=re.M)
    assert count == 1
    (tmp_path / "part.frd").write_text(text)
    with pytest.raises(InputError, match=said) as refused:
        read_stress(tmp_path / "part.frd", results[1])
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("number", [99, -1])
def test_a_cell_of_points_that_are_not_there_is_one_line(tmp_path, box, number):
    cells = box.cells.copy()
    cells[3, 1] = number
    spoiled = SimpleNamespace(points=box.points, cells=cells, order=1, patches={}, axes={})
    vtu.write(spoiled, tmp_path / "part.vtu", cell={"stress": np.ones((len(cells), 9))})
    with pytest.raises(InputError, match=rf"a cell names point {number}, and there are 0 to"):
        read_stress(tmp_path / "part.vtu", box, "MPa")


def steps(text, *headings):
    """Result file with the stress of several steps: k times the first, below these headings.

    As CalculiX 2.20 writes them: 1PSTEP with step last, 100C with time or frequency and kind.
    """
    start = text.index(" -4  STRESS")
    first, rest = text[:start], text[start : text.index(" 9999")]
    blocks = []
    for k, (step, value, kind) in enumerate(headings, 1):
        blocks.append(f"    1PSTEP{k:26d}{1:12d}{step:12d}          ")
        blocks.append(
            f"  100CL  {100 + k:3d}{value:12.5E}{273:12d}{'':20s}{kind:2d}{k:5d}{'':10s} 1"
        )
        blocks.append(re.sub(
            r"^( -1.{10})(.*)$",
            lambda row, k=k: row[1] + "".join(
                f"{k * float(row[2][c : c + 12]):12.5E}" for c in range(0, 72, 12)
            ),
            rest.rstrip(),
            flags=re.M,
        ))  # fmt: skip
    return "\n".join([first.rstrip(), *blocks, " 9999"]) + "\n"


STATIC, FREQUENCY, BUCKLING = 0, 2, 4


@pytest.mark.parametrize(
    ("headings", "step", "times", "said"),
    [
        (((1, 1.0, STATIC),), None, 1, "^the stress of part.frd is taken for MPa"),
        (
            ((1, 1.0, STATIC), (2, 2.0, STATIC)),
            None,
            0,
            r"steps: step 1 .time 1., step 2 .time 2.: ",
        ),
        (
            ((1, 1.0, STATIC), (2, 2.0, STATIC)),
            1,
            1,
            r"of part.frd the stress of step 1 .time 1. is",
        ),
        (((1, 1.0, STATIC), (2, 2.0, STATIC)), 2, 2, "the stress of step 2"),
        (
            ((1, 1.0, STATIC), (2, 2.0, STATIC)),
            3,
            0,
            r"no stress of loads in step 3; .* choose anoth",
        ),
        (((1, 0.5, STATIC), (1, 1.0, STATIC)), None, 2, r"the stress of step 1 .time 1. is taken"),
        (((1, 1.0, STATIC), (2, 318.0, FREQUENCY)), None, 1, "the stress of step 1"),
        (((1, 1.0, STATIC), (2, 318.0, FREQUENCY)), 2, 0, r"step 2 .mode 318.: choose another"),
        (((1, 318.0, FREQUENCY),), None, 0, r"modes only, which has no size: step 1 .mode 318."),
        (((1, 0.0, BUCKLING), (1, 15.3, BUCKLING)), None, 1, r"the stress of step 1 .time 0."),
    ],
)
def test_stress_of_several_steps(tmp_path, results, headings, step, times, said):
    text, mesh, stress = results
    path = tmp_path / "part.frd"
    path.write_text(steps(text, *headings))
    if times == 0:
        with pytest.raises(InputError, match=said) as refused:
            read_stress(path, mesh, step=step)
        assert "\n" not in str(refused.value)
        return
    given = read_stress(path, mesh, step=step)
    np.testing.assert_allclose(to_voigt(given.nodal), times * stress, rtol=2e-5)
    assert re.search(said, given.assumed)


def test_what_a_file_has_no_choice_of_is_refused(tmp_path, results, field, written):
    (tmp_path / "part.frd").write_text(results[0])
    with pytest.raises(
        InputError,
        match=r"only \.vtu, \.vtk, \.xdmf files .* array 'S' .* leave --stress-array out",
    ):
        read_stress(tmp_path / "part.frd", results[1], array="S")
    with pytest.raises(
        InputError, match=r"only \.frd, \.xdmf files .* step '2' .* leave --stress-step out"
    ):
        read_stress(written, field.mesh, step=2)


def test_a_result_file_must_be_one(tmp_path):
    mesh = box_mesh((1.0, 1.0, 1.0), (1, 1, 1))
    (tmp_path / "empty.frd").write_text("    1C\n 9999\n")
    with pytest.raises(InputError, match="has no mesh of solids"):
        read_stress(tmp_path / "empty.frd", mesh, "MPa")
    with pytest.raises(InputError, match="stress file"):
        read_stress(tmp_path / "none.frd", mesh, "MPa")
