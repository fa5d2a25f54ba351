"""Spoiled files of every format: read, or refused in one line. More: python -m benchmarks.fuzz."""

import random
import warnings

import numpy as np
import pytest

from benchmarks.fuzz.__main__ import read, solve_sizes
from benchmarks.fuzz.mutants import good_files, mutants, part_of_sizes
from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh import box_mesh

COUNTS = {
    **dict.fromkeys(("part.toml", "box.inp", "scopes.inp", "box.tet", "box.npz"), 40),
    **dict.fromkeys(("stress.frd", "stress.csv", "paths.csv", "paths.txt"), 40),
    **dict.fromkeys(("box.vtu", "box.stl", "box.msh", "stress.vtu"), 1),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    good_files(folder)
    return folder


def test_the_good_ones_read(folder):
    for name in COUNTS:
        read(folder / name)
    assert set(read_mesh(folder / "box.inp").patches) >= {"FOOT", "OUTER", "SKIN"}


@pytest.mark.parametrize("name", COUNTS)
def test_spoiled_files(folder, name, capfd):
    target, said = folder / f"mutant_{name}", []
    for spoiled in mutants((folder / name).read_bytes(), COUNTS[name], "short"):
        target.write_bytes(spoiled)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                read(target)
            except InputError as error:
                said.append(str(error))
    assert said or COUNTS[name] == 1
    assert not [line for line in said if "\n" in line or len(line) >= 2000]
    assert capfd.readouterr() == ("", "")


def test_sizes_over_twelve_decades(folder):
    """Each is refused in one line, or solved, and remarked on where it moves too far."""
    chance, refused = random.Random("short"), []
    for _ in range(20):
        text, _ = part_of_sizes(chance)
        (folder / "sizes.toml").write_text(text)
        try:
            solve_sizes(folder / "sizes.toml")
        except InputError as error:
            refused.append(str(error))
    assert 0 < len(refused) < 20
    assert not [line for line in refused if "\n" in line]


def test_a_generated_set_of_a_thousand_million(folder):
    text = (folder / "box.inp").read_text()
    path = folder / "large.inp"
    path.write_text(text.replace("1, 12, 2", "1, 1000000000"))
    mesh = read_mesh(path)
    assert len(mesh.patches["SOME"]) == len(mesh.boundary)


def test_a_set_that_holds_itself(folder):
    text = (folder / "box.inp").read_text()
    path = folder / "nested.inp"
    path.write_text(text.replace("OUTER\nFOOT\n", "OUTER\n" + "OUTER, OUTER, FOOT\n" * 50))
    mesh = read_mesh(path)
    assert np.array_equal(mesh.patches["OUTER"], mesh.patches["FOOT"])


def test_an_archive_that_unpacks_to_gigabytes(tmp_path):
    mesh, path = box_mesh((2.0, 1.0, 1.0), (2, 1, 1)), tmp_path / "bomb.npz"
    np.savez_compressed(path, points=mesh.points, cells=mesh.cells, more=np.zeros(50_000_000, "i1"))
    with pytest.raises(InputError, match="as no mesh does"):
        read_mesh(path)
