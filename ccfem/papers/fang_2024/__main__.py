"""Run the study of Fang et al. 2024, and write its tables and the claims beside ours.

    python -m ccfem.papers.fang_2024 FOLDER

with ``CCFEM_FANG2024`` naming the authors' data; half an hour.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from ccfem.comparison.slicings_files import write_slicings
from ccfem.export.robot_waypoints import write_robot_waypoints
from ccfem.machine import Machine
from ccfem.papers.fang_2024.authors import authors_mesh, authors_stress, finer_mesh
from ccfem.papers.fang_2024.claims import quantities, verdicts
from ccfem.papers.fang_2024.field_study import field_study, field_table
from ccfem.papers.fang_2024.planar_against_curved import against
from ccfem.papers.fang_2024.t_bracket import study, timed_chain
from ccfem.papers.verdicts import claim_table
from ccfem.plot.canvas import png
from ccfem.plot.stack_page import space_picture, turning_page


def main(folder: Path, loads: Sequence[str] = ("pull", "side")) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    tests = {}
    for load in loads:
        tests[load] = against(load)
        (folder / load).mkdir(exist_ok=True)
        write_slicings(tests[load], folder / load)
    stress = authors_stress(authors_mesh())
    sliced, paths, seconds = timed_chain(stress)
    strands = study(stress, sliced)
    title, build = "T-bracket, spatial layers, winding strands", (0.0, 1.0, 0.0)
    picture = png(space_picture(sliced.layers, paths, title, build))
    (folder / "t_bracket.png").write_bytes(picture)
    page = turning_page(sliced.layers, paths, title, build)
    (folder / "t_bracket.html").write_text(page, encoding="utf-8")
    write_robot_waypoints(folder / "waypoints.csv", paths, sliced.layers, Machine())
    field = field_study(sliced)
    print(f"\n{field_table(field)}")
    finer = timed_chain(authors_stress(finer_mesh(), order=1))[2]
    found = quantities(field, strands, seconds, tests)
    found["170 k cells: seconds"] = finer["all, clock"]
    (folder / "quantities.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    claims = claim_table(verdicts(found))
    (folder / "claims.md").write_text(claims, encoding="utf-8")
    print(f"\n{claims}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/fang_2024"))
