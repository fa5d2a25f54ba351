"""Parts that are printed on paper: three cases and a plate from a part file."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import shapely

from benchmarks.print_checks.job import Job
from benchmarks.print_checks.sections import Sections
from ccfem.body.mesh.curved_cells import EDGES
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases import Case, create_case
from ccfem.cases.inspection.beginning import examples
from ccfem.cases.part_file import read_part
from ccfem.fem.elasticity import solve
from ccfem.fem.elasticity.stress_field import PartStress
from ccfem.machine import machine_table, updated
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.bed_layout import AS_IT_STANDS, BedLayout
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import plan_print
from ccfem.printing.support.overhang import overhang
from ccfem.printing.together import arranged
from ccfem.slicing.layers.layer import Layer, plane_frame
from ccfem.strategies import create

__all__ = ["PARTS", "Part", "job_of", "on_bed"]

PARTS = {"loop": "isocurve", "bridge": "svt", "bracket": "svt", "plate": "svt"}
"""Strategy for each part."""

_BENT = 1.01
"""How much faster a strand may be in a turn than the check's own radius allows (`Job.bent`)."""


@dataclass(frozen=True)
class Part:
    """A case that is solved and cut into layers."""

    case: Case
    name: str
    stress: PartStress

    @classmethod
    def named(cls, name: str) -> "Part":
        """Solve one of `PARTS`."""
        case = _plate() if name == "plate" else create_case(name)
        stress = solve(case.problem)
        return cls(case, name, stress[case.problem.cases[0]])

    def layers(self) -> Sequence[Layer]:
        """Layers of the case."""
        return self.case.fibre_layers(self.stress)


def _plate() -> Case:
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "plate.toml"
        file.write_text(examples()["bracket_plate"])
        return read_part(file)


def job_of(
    part: Part, machine_name: str, layout: BedLayout = AS_IT_STANDS
) -> tuple[Job, dict[str, float]]:
    """Plan a part for a machine, write its file and follow it; seconds of each."""
    case = part.case
    machine, mesh = updated(case.machine, machine_table(machine_name)), case.problem.mesh
    chosen, layers = PARTS.get(part.name, "concentric"), part.layers()
    began = time.process_time()
    strategy = create(chosen, dict(case.parameters.get(chosen, {})))
    paths = plan(strategy, layers, part.stress, machine)
    planned = time.process_time()
    hangs = overhang(mesh, case.build, machine) is not None
    alone = plan_print(paths, layers, mesh, machine, hangs, layout.spin, case.plastic)
    printed = arranged([alone], [layout], machine)
    text = gcode(printed, machine)
    written = time.process_time()
    low = alone.paths.points[:, :2].min(axis=0)
    places = [np.array(one.low) - low for one in printed.standing]
    copies = on_bed(paths, mesh, case.build, machine.gcode.bed, layout.spin, places)
    job = Job(
        machine_name,
        machine,
        printed,
        text,
        [line for strands, _ in copies for line in strands],
        cache(lambda z: shapely.union_all([sections.region(z) for _, sections in copies])),
        lambda z: sum(sections.area(z) for _, sections in copies),
        layout.count * float(mesh.volumes.sum()),
        _BENT,
        _chords(mesh),
    )
    followed = time.process_time()
    spent = {"plan": planned - began, "write": written - planned, "follow": followed - written}
    return job, spent


def _chords(mesh: TetMesh) -> float:
    """How far middles of sides are off the round walls of a part, mm."""
    round_mesh = mesh.quadratic()
    ends = round_mesh.points[round_mesh.cells[:, EDGES]].mean(axis=2)
    return float(np.linalg.norm(round_mesh.points[round_mesh.cells[:, 4:]] - ends, axis=2).max())


def on_bed(
    paths: Toolpaths,
    mesh: TetMesh,
    build: Sequence[float],
    bed: Sequence[float],
    spin: float,
    places: Sequence[np.ndarray],
) -> list[tuple[list[np.ndarray], Sections]]:
    """Strands on the bed, and sections of the part there by height, of each copy.

    Places (2,) are shifts of copies from where one stands in the middle of the bed.
    """
    turn = np.radians(spin)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    frame = plane_frame(tuple(build)).copy()
    frame[:2] = axes @ frame[:2]
    corners = mesh.points[np.unique(mesh.corners)] @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = 0.5 * (low + high)[:2] - 0.5 * np.array(bed[:2])
    found = []
    for place in places:
        shift = np.append(middle - place, low[2])
        found.append(([line @ frame.T - shift for line in paths], Sections(mesh, frame, shift)))
    return found
