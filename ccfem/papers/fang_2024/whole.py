"""The whole of the paper: its study, figures, tables and claims beside ours."""

import json
from collections.abc import Sequence
from pathlib import Path

from ccfem.base.progress import Progress, silent
from ccfem.comparison.files import write_results
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.stack_page import space_picture, turning_page
from ccfem.comparison.result import Comparison
from ccfem.machine import Machine
from ccfem.papers.fang_2024.authors import authors_mesh, authors_stress, finer_mesh
from ccfem.papers.fang_2024.claims import quantities, verdicts
from ccfem.papers.fang_2024.field_study import field_study, field_table
from ccfem.papers.fang_2024.planar_against_curved import against
from ccfem.papers.fang_2024.t_bracket import study, timed_chain
from ccfem.papers.fang_2024.targets import field_figures, targets_table
from ccfem.papers.fang_2024.where_layers_open import (
    bonds_needed,
    openings,
    openings_picture,
    openings_table,
)
from ccfem.papers.verdicts import claim_table
from ccfem.paths.toolpaths import MATRIX
from ccfem.printing.export.robot_waypoints import write_robot_waypoints


def write_all(
    folder: Path, progress: Progress = silent, loads: Sequence[str] = ("pull", "side")
) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    progress("solving the authors' part", 0.0)
    stress = authors_stress(authors_mesh())
    chain = timed_chain(stress)
    sliced, paths = chain.sliced, chain.strands
    finer = timed_chain(authors_stress(finer_mesh(), order=1)).seconds
    strands = study(stress, sliced)
    laid = set(paths.layer.tolist())
    reached = field_figures(sliced, stress, laid)
    targets = targets_table(reached, strands, chain.seconds, finer)
    (folder / "targets.md").write_text(targets, encoding="utf-8")
    print(f"\n{targets}", flush=True)
    title, build = "T-bracket, spatial layers, winding strands", (0.0, 1.0, 0.0)
    picture = png(space_picture(sliced.layers, paths, title, build))
    (folder / "t_bracket.png").write_bytes(picture)
    page = turning_page(sliced.layers, paths, title, build)
    (folder / "t_bracket.html").write_text(page, encoding="utf-8")
    machine = Machine()
    write_robot_waypoints(folder / "waypoints.csv", paths, sliced.layers, machine)
    matrix = folder / "matrix_waypoints.csv"
    write_robot_waypoints(matrix, chain.matrix, sliced.layers, machine, MATRIX)
    field = field_study(sliced)
    print(f"\n{field_table(field)}", flush=True)
    tests: dict[str, Comparison] = {}
    for load in loads:
        progress(f"comparing slicings under load {load}", 0.3 + 0.3 * len(tests))
        tests[load] = against(load)
        (folder / load).mkdir(exist_ok=True)
        write_results(tests[load], folder / load)
    found = quantities(field, strands, chain.seconds, tests)
    found["170 k cells: seconds"] = finer["all, clock"]
    if "pull" in tests:
        found |= _failures_explained(tests["pull"], folder)
    (folder / "quantities.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    claims = claim_table(verdicts(found))
    (folder / "claims.md").write_text(claims, encoding="utf-8")
    print(f"\n{claims}")


def _failures_explained(pulled: Comparison, folder: Path) -> dict[str, float]:
    """Print and draw where layers open under the pull; what bond the paper's loads would need."""
    where = {"walls fixed": openings(pulled), "bolts press": openings(pulled, pressing=True)}
    tensile = pulled.case.problem.material.interlayer_tensile
    assert tensile is not None
    table = openings_table(where, tensile)
    (folder / "where_layers_open.md").write_text(table, encoding="utf-8")
    title = f"Pull on the head: load that opens the layers, bond of {tensile:g} MPa"
    openings_picture(where, title, folder / "where_layers_open.png")
    print(f"\n{table}", flush=True)
    return bonds_needed(where, tensile)
