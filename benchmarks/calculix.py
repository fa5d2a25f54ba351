"""Decks solved by ccfem and by CalculiX: ``python -m benchmarks.calculix FOLDER``.

Every deck (.inp) of a folder that you name is solved by both programs on the cells that it has.
The table gives, for each load case, the largest difference of a displacement, of a stress (the
mean of a cell) and of the resultant of the supports, over the largest of each. Decks are not stored
here: fetch those of the CalculiX examples, or take your own. CalculiX is the command ``ccx``, or
the one that ``--ccx`` names. On linear cells it lumps centrifugal loads at the centre of a cell,
which differs by some per cent on coarse meshes.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError, SolveError
from ccfem.body.files.deck import ELEMENTS, NODES, Model, read_deck
from ccfem.cases.part_file import part_case
from ccfem.fem.elasticity import StressField, prepare, solve
from ccfem.fem.elasticity.loads import heat_forces

_ALL = "CCFEM_ALL"
"""Name of the set of all nodes, and of all cells, that a copy of a deck gets."""
_SECONDS = 600
"""Time that CalculiX may take for a deck."""


def main() -> None:
    """Print the table."""
    words = argparse.ArgumentParser(prog="benchmarks.calculix", description=__doc__)
    words.add_argument("folder", type=Path, help="folder of decks (.inp)")
    words.add_argument("--ccx", default="ccx", help="command of CalculiX")
    given = words.parse_args()
    decks = sorted(given.folder.glob("*.inp"))
    if not decks:
        sys.exit(f"{given.folder} holds no deck (.inp): name a folder of some")
    if shutil.which(given.ccx) is None:
        sys.exit(f"CalculiX is not there as '{given.ccx}': install it, or name it by --ccx")
    print("| deck | load case | cells | displacement | stress | reactions |")
    print("|---|---|---|---|---|---|")
    for path in decks:
        try:
            for row in compared(path, given.ccx):
                print(f"| {path.name} | {row} |", flush=True)
        except (InputError, SolveError, subprocess.SubprocessError) as error:
            print(f"| {path.name} | {' '.join(str(error).split())} | | | | |", flush=True)


def compared(path: Path, ccx: str = "ccx") -> list[str]:
    """Rows of the table of one deck, a row a load case.

    Raises
    ------
    InputError
        For a deck that ccfem does not take over, or that CalculiX does not solve.
    """
    model, _ = read_deck(path)
    linear = any(kind == "tetra" for kind, _ in model.blocks)
    content = {"mesh": path.name, "analysis": "deck", "order": 1 if linear else 2}
    fields = solve(part_case(content, path).problem)
    steps = by_calculix(path, model, ccx)
    if len(steps) != len(fields):
        raise InputError(
            f"CalculiX gives {len(steps)} steps and ccfem {len(fields)} load cases: take a deck "
            "whose steps are static and loaded"
        )
    places = model.points[model.rows[NODES, ""].rows]
    rows = []
    for tables, (name, field) in zip(steps, fields.items(), strict=True):
        differences = _differences(field, places, *tables)
        shown = " | ".join(f"{difference:.2%}" for difference in differences)
        rows.append(f"{name} | {len(field.stress):,} | {shown}")
    return rows


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
    printed = f"*NODE PRINT, NSET={_ALL}\nU, RF\n*EL PRINT, ELSET={_ALL}, GLOBAL=YES\nS\n"
    text = re.sub(r"(?mi)^(?=\s*\*end\s*step\b)", printed, text)
    text = re.sub(r"(?mi)^(?=\s*\*step\b)", sets, text, count=1)
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


def _differences(
    field: StressField,
    places: FloatArray,
    displacement: FloatArray,
    force: FloatArray,
    stress: FloatArray,
) -> tuple[float, float, float]:
    """Largest differences of displacement, stress and resultant, over the largest of each.

    CalculiX prints the forces inside the part at each node: the reaction and the load on it.
    """
    mesh, problem = field.mesh, field.problem
    at = cKDTree(places).query(mesh.points)[1]
    moved = displacement[at, 1:] - field.displacement
    xx, yy, zz, xy, xz, yz = stress[:, 1:].T
    tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
    loads = prepare(problem).forces_in(field.case) - heat_forces(problem, field.case)
    inside = field.reactions + loads
    held = field.reactions.any(axis=1)
    apart = force[at][held, 1:].sum(axis=0) - inside[held].sum(axis=0)
    size = np.linalg.norm(inside[held], axis=1).sum()
    return (
        float(np.linalg.norm(moved, axis=1).max() / np.abs(field.displacement).max()),
        float(np.abs(tensor - field.stress).max() / max(np.abs(field.stress).max(), 1e-300)),
        float(np.linalg.norm(apart) / max(size, 1e-300)),
    )


if __name__ == "__main__":
    main()
