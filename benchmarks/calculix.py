"""Decks solved by ccfem and by CalculiX: ``python -m benchmarks.calculix FOLDER``.

Every deck (.inp) of a folder that you name is solved by both programs on the cells that it has;
hexahedra and wedges are split, and linear ones of these solved as quadratic tetrahedra, while
CalculiX takes C3D8 as C3D8I, since they are too stiff in bending. The table
gives, for each load case, the largest difference of a displacement, of a stress (the mean of a
cell) and of the resultant of the supports, over the largest of each. Where the results of a deck
lie beside it (NAME.dat.ref or NAME.dat, as in the CalculiX test suite), the displacements that they
print are compared, too. A deck that is not taken over has the reason in its row. NLGEOM is taken
out, since ccfem leaves it out.

``--tetrahedra`` gives CalculiX the tetrahedra into which ccfem splits the cells of a deck: what
then differs is not the cells, but what was taken over.

Decks are not stored here: take your own, or fetch those of the CalculiX test suite and of FreeCAD's
tests, as Debian's packages ``calculix-ccx-test`` and ``freecad-common`` have them.
CalculiX is the command ``ccx``, or the one that ``--ccx`` names; without it there are the results
beside the decks. On linear cells it lumps centrifugal loads at the centre of a cell, which differs
by some per cent on coarse meshes.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError, SolveError
from ccfem.base.tensor import from_voigt
from ccfem.body.files.cells import tetrahedra as split_cells
from ccfem.body.files.deck import ELEMENTS, NODES, Model, chosen_rows, read_deck
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.curved_cells import gradients_at
from ccfem.cases.part_file import part_case
from ccfem.fem.elasticity import StressField, prepare, solve
from ccfem.fem.elasticity.loads import free_strain, heat_forces
from ccfem.fem.elasticity.recovery import times, voigt_strain

_ALL = "CCFEM_ALL"
"""Name of the set of all nodes, and of all cells, that a copy of a deck gets."""
_SAME = 1e-6
"""Distance of two nodes over the size of the part within which they are the same."""
_LOCAL = "L"
"""Behind the components that CalculiX prints along the axes of a *TRANSFORM."""
_SHARE = (5.0 - 5.0**0.5) / 20.0
"""Least barycentric coordinate of the four points of a tetrahedron at which CalculiX integrates."""
_PRINTS = ("NODE PRINT", "EL PRINT", "NODE FILE", "EL FILE", "HEADING")
"""Keywords that a deck does without."""
_SECONDS = 600
"""Time that CalculiX may take for a deck."""


def main() -> None:
    """Print the table."""
    words = argparse.ArgumentParser(prog="benchmarks.calculix", description=__doc__)
    words.add_argument("folder", type=Path, help="folder of decks (.inp)")
    words.add_argument("--ccx", default="ccx", help="command of CalculiX")
    words.add_argument("--tetrahedra", action="store_true", help="the same cells in both")
    given = words.parse_args()
    decks = sorted(given.folder.glob("*.inp"))
    if not decks:
        sys.exit(f"{given.folder} holds no deck (.inp): name a folder of some")
    ccx = given.ccx if shutil.which(given.ccx) else None
    if ccx is None and not any(results_beside(path) for path in decks):
        sys.exit(
            f"CalculiX is not there as '{given.ccx}', nor results beside the decks (.dat.ref): "
            "install it, or name it by --ccx"
        )
    print("| deck | load case | cells | displacement | stress | reactions | beside the deck |")
    print("|---|---|---|---|---|---|---|")
    for path in decks:
        try:
            for row in compared(path, ccx, given.tetrahedra):
                print(f"| {path.name} | {row} |", flush=True)
        except (InputError, SolveError, subprocess.SubprocessError) as error:
            print(f"| {path.name} | {' '.join(str(error).split())} | | | | | |", flush=True)


def compared(path: Path, ccx: str | None = "ccx", tetrahedra: bool = False) -> list[str]:
    """Rows of the table of one deck, a row a load case; without CalculiX as far as that goes.

    With `tetrahedra` both take the deck on those into which its cells are split.

    Raises
    ------
    InputError
        For a deck that ccfem does not take over, or that CalculiX does not solve.
    """
    if tetrahedra:
        with tempfile.TemporaryDirectory() as folder:
            other = Path(folder) / path.name
            other.write_text(split_deck(path), encoding="utf-8")
            return compared(other, ccx)
    model, _ = read_deck(path)
    linear = {kind for kind, _ in model.blocks} == {"tetra"}
    content = {"mesh": path.name, "analysis": "deck", "order": 1 if linear else 2}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # remarks on the mesh
        fields = solve(part_case(content, path).problem)
    steps = [] if ccx is None else by_calculix(path, model, ccx)
    beside = results_beside(path)
    for what, count in (("CalculiX gives", len(steps)), ("its results hold", len(beside))):
        if count not in (0, len(fields)):
            raise InputError(
                f"{what} {count} steps and ccfem {len(fields)} load cases: take a deck whose steps "
                "are static and loaded"
            )
    rows = []
    for k, (name, field) in enumerate(fields.items()):
        shown = ["", "", ""]
        if steps:
            shown = [f"{x:.2%}" for x in _differences(field, model, *steps[k])]
        if beside:
            shown.append(f"{_largest_difference(field, model, beside[k]):.2%}")
        rows.append(" | ".join([name, f"{len(field.stress):,}", *shown, *([] if beside else [""])]))
    return rows


def split_deck(path: Path) -> str:
    """Text of a deck on the tetrahedra into which its cells are split.

    Added nodes are in the sets that both ends of their diagonal are in, but for those of forces.

    Raises
    ------
    InputError
        For a deck with loads on faces, which have other numbers then, or with temperatures.
    """
    model, deck = read_deck(path)
    split, words = (
        split_cells(model.points, model.blocks, path),
        {block.keyword for block, _ in deck.rest},
    )
    faces = any(re.search(r",\s*[PS]\d", line) for block, _ in deck.rest for line in block.lines)
    if faces or words & {"TEMPERATURE", "SURFACE"} or len(model.scopes) > 1:
        raise InputError("a deck with temperatures, parts, or loads on faces is not split")
    forces = {x.split(",")[0].strip().upper() for block, _ in deck.rest for x in block.lines
              if block.keyword == "CLOAD"}  # fmt: skip
    lines = ["*NODE"]
    lines += [f"{k}, {x!r}, {y!r}, {z!r}" for k, (x, y, z) in enumerate(split.points.tolist(), 1)]
    lines.append(f"*ELEMENT, TYPE=C3D{split.cells.shape[1]}")
    lines += [
        ", ".join(map(str, [k, *cell])) for k, cell in enumerate((split.cells + 1).tolist(), 1)
    ]
    for (kind, name), members in model.scopes[""].sets.items():
        rows = chosen_rows(model, "", kind, members)
        word = "NSET" if kind == NODES else "ELSET"
        if kind == NODES:
            inside = np.isin(np.arange(len(split.points)), rows)
            inside[len(inside) - len(split.ends) :] = inside[split.ends].all(axis=1)
            chosen = rows if name in forces else np.flatnonzero(inside)
        else:
            chosen = np.flatnonzero(np.isin(split.parent, rows))
        lines += [f"*{word}, {word}={name}", *(f"{k + 1}," for k in chosen.tolist())]
    for block, _ in deck.rest:
        if block.keyword in _PRINTS:
            continue
        given = "".join(f", {k}={v}" if v else f", {k}" for k, v in block.parameters.items())
        lines.append(f"*{block.keyword}{given}")
        for line in block.lines:
            first, comma, rest = line.partition(",")
            if block.keyword in ("BOUNDARY", "CLOAD") and first.strip().isdecimal():
                first = str(int(model.rows[NODES, ""].at(np.array([int(first)]))[0]) + 1)
            lines.append(first + comma + rest)
    return "\n".join(lines) + "\n"


def results_beside(path: Path) -> list[FloatArray]:
    """Tables (n, 4) of node and displacement, a table a step, of a file beside a deck, if any.

    Those along local axes are not taken.
    """
    for suffix in (".dat.ref", ".dat"):
        file = path.with_suffix(suffix)
        if file.exists():
            bodies = re.findall(
                r"^ displacements \(.*\n\n((?:.*\S.*\n)*)", file.read_text(errors="replace"), re.M
            )
            rows = [[line.split() for line in body.splitlines()] for body in bodies]
            if any(row[-1] == _LOCAL for table in rows for row in table):
                return []
            return [np.array(table, dtype=float) for table in rows]
    return []


def by_calculix(
    path: Path, model: Model, ccx: str = "ccx"
) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Solve a deck with CalculiX.

    Returns
    -------
    list of (displacement, force, stress), an entry a step
        (n, 4) arrays of the label and three components of each node, and (m, 7) of the label and
        the mean stress of each cell, xx, yy, zz, xy, xz and yz.
    """
    labels = {kind: model.rows[kind, ""].labels.tolist() for kind in (NODES, ELEMENTS)}
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    if re.search(r"^\s*\*(part|instance|include)\b", text, flags=re.M | re.I):
        raise InputError("decks of several files or with parts are not taken: write it flat")
    sets = "".join(
        f"*{word}, {word}={_ALL}\n" + "".join(f"{label},\n" for label in labels[kind])
        for word, kind in (("NSET", NODES), ("ELSET", ELEMENTS))
    )
    printed = (
        f"*NODE PRINT, NSET={_ALL}, GLOBAL=YES\nU, RF\n*EL PRINT, ELSET={_ALL}, GLOBAL=YES\nS\n"
    )
    text = re.sub(r"(?mi)^(?=\s*\*end\s*step\b)", printed, text)
    text = re.sub(r"(?mi)^(?=\s*\*step\b)", sets, text, count=1)
    text = re.sub(r"(?i)^(\*step\b.*?), *NLGEOM *(= *\w+)?", r"\1", text, flags=re.M)
    text = re.sub(r"(?i)(\*element\b.*type\s*=\s*C3D8)\s*(?=,|$)", r"\1I", text, flags=re.M)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "deck.inp").write_text(text, encoding="utf-8")
        run = subprocess.run(
            [ccx, "deck"], cwd=folder, capture_output=True, text=True, timeout=_SECONDS, check=False
        )
        result = Path(folder) / "deck.dat"
        if "*ERROR" in run.stdout or not result.exists():
            said = re.findall(r"\*ERROR.*", run.stdout)[:1] or [f"exit code {run.returncode}"]
            raise InputError(f"CalculiX does not solve it: {said[0]}")
        return _steps(result.read_text())


def _steps(text: str) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Tables of the steps of a .dat file."""
    found: dict[str, list[FloatArray]] = {"displacements": [], "forces": [], "stresses": []}
    for title, body in re.findall(
        r"^ ([a-z]+) \(.*set " + _ALL + r" .*\n\n((?:.*\S.*\n)*)", text, re.M
    ):
        table = np.array([line.split() for line in body.splitlines()], dtype=float)
        if title == "stresses":
            cells, first = np.unique(table[:, 0], return_index=True)
            sums = np.add.reduceat(table[:, 2:], first)
            table = np.column_stack([cells, sums / np.diff([*first, len(table)])[:, None]])
        found[title].append(table)
    return list(zip(*found.values(), strict=True))


def _largest_difference(field: StressField, model: Model, table: FloatArray) -> float:
    """Largest difference of the displacement at nodes of solids, over the largest of all."""
    rows = model.rows[NODES, ""].at(table[:, 0].astype(np.int64))
    of_solid = np.isin(rows, model.nodes[~model.flat])
    distance, at = cKDTree(field.mesh.points).query(model.points[rows[of_solid]])
    assert (distance <= _SAME * np.ptp(field.mesh.points)).all()
    apart = table[of_solid, 1:] - field.displacement[at]
    return float(np.linalg.norm(apart, axis=1).max() / np.abs(field.displacement).max())


def _stress(field: StressField) -> FloatArray:
    """Stress (m, 3, 3) of each cell as CalculiX has it, the mean at four points of quadratic ones.

    On a curved cell that is not the stress at its centre.
    """
    mesh, problem = field.mesh, field.problem
    if mesh.order == 1:
        return field.stress
    free, total = free_strain(problem, field.case), np.zeros((len(mesh.cells), 6))
    nodes, moved = mesh.points[mesh.cells], field.displacement[mesh.cells].transpose(0, 2, 1)
    for at in np.full((4, 4), _SHARE) + (1.0 - 4.0 * _SHARE) * np.eye(4):
        strain = voigt_strain(moved @ gradients_at(nodes, at))
        if free is not None:
            strain = strain - np.einsum("a,mai->mi", at, free)
        total += times(problem.cell_stiffness, strain)
    return from_voigt(0.25 * total)


def _differences(
    field: StressField,
    model: Model,
    displacement: FloatArray,
    force: FloatArray,
    stress: FloatArray,
) -> tuple[float, float, float]:
    """Largest differences of displacement, stress and resultant, over the largest of each.

    CalculiX prints the forces inside the part at each node: the reaction and the load on it.
    """
    mesh, problem = field.mesh, field.problem
    places = model.points[model.rows[NODES, ""].rows]
    near, at = cKDTree(places).query(mesh.points)
    xx, yy, zz, xy, xz, yz = stress[:, 1:].T
    tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
    # Of an element that was split the mean of its tetrahedra is compared.
    split = split_cells(model.points, model.blocks, "deck")
    row = cKDTree(TetMesh(split.points, split.cells).centres).query(mesh.centres)[1]
    parent, weight = split.parent[row], mesh.volumes
    parts = _stress(field).reshape(-1, 9).T
    sums = np.array([np.bincount(parent, weight * part) for part in parts]).T
    mean = (sums / np.bincount(parent, weight)[:, None]).reshape(-1, 3, 3)
    loads = prepare(problem).forces_in(field.case) - heat_forces(problem, field.case)
    inside = field.reactions + loads
    held = field.reactions.any(axis=1)
    of_deck = held & (near <= _SAME * np.ptp(mesh.points))
    apart = force[at][of_deck, 1:].sum(axis=0) - inside[held].sum(axis=0)
    size = np.linalg.norm(inside[held], axis=1).sum() + np.linalg.norm(loads, axis=1).sum()
    return (
        _largest_difference(field, model, displacement),
        float(np.abs(tensor - mean).max() / max(np.abs(mean).max(), 1e-300)),
        float(np.linalg.norm(apart) / max(size, 1e-300)),
    )


if __name__ == "__main__":
    main()
