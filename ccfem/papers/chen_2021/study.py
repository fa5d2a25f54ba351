"""What the figures and the claims of the paper are computed from.

On the authors' Loop where ``CCFEM_CHEN2021`` names their folder, else on the case `loop`, which
has its size and loads. The authors published their Shell, bar and Wrench too, which are not run
here, and not their Piston. The places of these are taken by parts of ours that show the same thing:
a bar with a hole (`open_hole`), and `lifting_eye`, whose section changes from layer to layer as the
Piston's does.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.progress import Progress, silent
from ccfem.body.mesh import TetMesh
from ccfem.cases import create_case
from ccfem.cases.case import Case
from ccfem.fem.elasticity import Displacement, Force, Problem, StressField, cell_gradients, solve
from ccfem.fem.elasticity.problem import Support
from ccfem.judging.evaluation import Evaluation, evaluate
from ccfem.judging.virtual_testing import Specimen, virtual_test
from ccfem.papers.chen_2021.loop import FOLDER, authors_loop
from ccfem.papers.chen_2021.pipeline import LayerStages, VectorField, planned, vector_field
from ccfem.papers.contents import WhenAsked
from ccfem.paths.fields.tensile import Tension
from ccfem.paths.planning import plan, plan_to_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

# How far the principal directions turn when a part is pulled far: figure 14.
#
# The solver is linear. A large displacement is therefore made of small steps: each solves the part
# in the shape that the steps before left, adds its stress to what is there, turned with the
# material, and moves the nodes: an updated Lagrangian scheme of explicit steps. The material is
# isotropic and elastic; the paper's is stiffer along the fibre.


class Turned(NamedTuple):
    """Angles (m,) of the cells in [0, 90] degrees: in space, and against the turned material."""

    in_space: FloatArray
    in_material: FloatArray


def turns_at(
    problem: Problem, pull: FloatArray, stops: Sequence[float], step: float = 1.0
) -> dict[float, Turned]:
    """Angle that the tension of every cell has turned since the first step.

    Parameters
    ----------
    problem : Problem
        With the patches "support", which is held, and "load", which is moved.
    pull : (3,) array
        Unit vector.
    stops : sequence of float, mm
        Displacements to look at, growing.
    step : float, mm, default 1
        Displacement between two solves.

    Returns
    -------
    dict of displacement to Turned
    """
    mesh = problem.mesh
    turn = np.tile(np.eye(3), (len(mesh.cells), 1, 1))
    stress = np.zeros_like(turn)
    first = stress
    moved, angles = 0.0, {}
    for stop in stops:
        while moved < stop - 1e-9:
            by = min(step, stop - moved)
            field = _moved(mesh, problem, by * pull)
            increment = _rotations(mesh, field.displacement)
            stress = increment @ stress @ increment.mT + field.stress
            turn = increment @ turn
            mesh = TetMesh(mesh.points + field.displacement, mesh.cells, mesh.patches)
            first = stress if moved == 0.0 else first
            moved += by
        still = np.broadcast_to(np.eye(3), turn.shape)
        angles[stop] = Turned(turned_by(first, stress, still), turned_by(first, stress, turn))
    return angles


def turned_by(first: FloatArray, last: FloatArray, turn: FloatArray) -> FloatArray:
    """Angles (m,), degrees, between tensions, the first carried along by rotations (m, 3, 3)."""
    carried = np.einsum("mij,mj->mi", turn, np.linalg.eigh(first)[1][:, :, -1])
    now = np.linalg.eigh(last)[1][:, :, -1]
    cosine = np.abs(np.einsum("mi,mi->m", carried, now))
    return np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))


def _moved(mesh: TetMesh, problem: Problem, vector: FloatArray) -> StressField:
    """Solve one step: the patch "load" moves by a vector, "support" stays."""
    supports = (Support("support"), Support("load"))
    x, y, z = (float(v) for v in vector)
    move = Displacement("load", (x, y, z))
    step = Problem(mesh, problem.material, supports, {"step": (move,)}, order=1)
    return solve(step)["step"]


def _rotations(mesh: TetMesh, displacement: FloatArray) -> FloatArray:
    """Rotations (m, 3, 3) of the cells: the nearest ones to their deformation gradients."""
    gradient = np.einsum("mad,mae->mde", displacement[mesh.cells], cell_gradients(mesh)) + np.eye(3)
    left, _, right = np.linalg.svd(gradient)
    return left @ right


PARTS_AT_HAND = (
    "The authors published their Loop, Shell, bar and Wrench, not the Piston. The Loop is run "
    "here; `open_hole` and `lifting_eye` stand in for the others. Prints of Loop, Shell and bar "
    "are held against their virtual tests by `ccfem reproduce evidence`."
)
"""Which parts of the paper are published, and which are run."""
POWERS = (0.0, 0.5, 1.0, 2.0)
"""p of Eq. 5 that figure 9 is drawn for."""
PISTON_LAYERS = 66
"""Layers of the paper's Piston."""
DISPLACEMENTS = (4.0, 16.0)
"""Of figure 14, mm."""


@dataclass(frozen=True)
class Model:
    """A part, its stress, and every stage of the paper's algorithm on its layers."""

    name: str
    case: Case
    stress: StressField
    layers: tuple[Layer, ...]
    vectors: VectorField
    stages: list[LayerStages]

    @property
    def paths(self) -> Toolpaths:
        """Paths of all layers."""
        return joined(self.stages)

    @property
    def evaluation(self) -> Evaluation:
        """Indices of the paths."""
        return evaluate(self.paths, self.layers, self.stress, self.case.machine)


@dataclass(frozen=True)
class Study:
    """All that figures, tables and claims are made of, computed when it is first asked for.

    Attributes
    ----------
    models : mapping of name to Model
        "Loop", "Loop, pushed", "bar", "open_hole", "lifting_eye".
    step : float, mm
        Of the large displacement.
    """

    models: Mapping[str, Model]
    step: float = 1.0

    @property
    def loop(self) -> Model:
        """The part that most figures show."""
        return self.models["Loop"]

    @cached_property
    def powers(self) -> Mapping[float, Toolpaths]:
        """Figure 9: paths of the Loop by the power p."""
        return {power: self._planned(self.loop.vectors.tension, power) for power in POWERS}

    @cached_property
    def unprocessed(self) -> Toolpaths:
        """Figure 10 (a): without orientation and filter."""
        return self._planned(self.loop.vectors.unfiltered)

    @cached_property
    def compared(self) -> Mapping[str, tuple[Toolpaths, float]]:
        """Table 2: paths of equal length and the stiffness ratio of each."""
        return _compared(self.loop)

    @cached_property
    def turns(self) -> Mapping[float, Turned]:
        """Figure 14, by displacement, mm."""
        case = self.loop.case
        return turns_at(case.problem, _pull(case), DISPLACEMENTS, self.step)

    def _planned(self, tension: Tension, power: float = 1.0) -> Toolpaths:
        loop = self.loop
        machine = loop.case.machine
        return joined(planned(loop.layers, tension, loop.stress.held_or_loaded, machine, power))


def joined(stages: list[LayerStages]) -> Toolpaths:
    """Paths of several layers as one."""
    return Toolpaths.concatenate([layer.paths for layer in stages])


def model(name: str, case: Case, layers: int = 12) -> Model:
    """Solve a case and run the paper's algorithm on flat layers of it."""
    stress = next(iter(solve(case.problem).values()))
    cut = Planar(count=layers).cut(stress.mesh, case.build)
    vectors = vector_field(stress)
    stages = planned(cut, vectors.tension, stress.held_or_loaded, case.machine)
    return Model(name, case, stress, cut, vectors, stages)


def pushed(case: Case) -> Case:
    """Turn the force of a part round."""
    ((name, (load,)),) = case.problem.loads.items()
    assert isinstance(load, Force)
    x, y, z = load.vector
    back = replace(load, vector=(-x, -y, -z))
    return replace(case, problem=replace(case.problem, loads={name: (back,)}))


def run_study(
    element_size: float | None = None,
    layers: int = 12,
    step: float = 1.0,
    progress: Progress = silent,
) -> Study:
    """Prepare the study; all of it takes a minute and a half with the defaults.

    Parameters
    ----------
    element_size : float, mm, optional
        Of all parts, which then are ccfem's own; for a quick look, without `lifting_eye`.
    step : float, mm, default 1
        Of the large displacement.
    """
    sized = {} if element_size is None else {"element_size": element_size}

    def compute(name: str) -> Model:
        if name == "lifting_eye":
            return model(name, create_case(name), PISTON_LAYERS)
        if name in ("bar", "open_hole"):
            return model(name, create_case(name, **sized), layers)
        authors = element_size is None and bool(os.environ.get(FOLDER))
        loop = authors_loop(layers) if authors else create_case("loop", **sized)
        return model(name, loop if name == "Loop" else pushed(loop), layers)

    names = ("Loop", "Loop, pushed", "bar", "open_hole", "lifting_eye")
    chosen = names if element_size is None else names[:-1]
    return Study(WhenAsked(chosen, compute, progress, "solving and planning"), step)


def _compared(loop: Model) -> dict[str, tuple[Toolpaths, float]]:
    """Paths of equal length and what they make of the part, with fibres that carry tension only."""
    paths, machine = loop.paths, loop.case.machine
    wanted = float(paths.lengths.sum()) / len(loop.layers)
    designs = {
        "the paper's algorithm": paths,
        "contour_zigzag": plan_to_length(
            create("contour_zigzag", {"turns": "tight"}), loop.layers, loop.stress, machine, wanted
        ).toolpaths,
        "isocurve": plan(create("isocurve"), loop.layers, loop.stress, machine),
    }
    specimen = Specimen.of(loop.stress)
    return {
        name: (design, virtual_test(design, specimen, span=()).ratio)
        for name, design in designs.items()
    }


def _pull(case: Case) -> FloatArray:
    """Direction of the one force of a case."""
    ((load,),) = case.problem.loads.values()
    assert isinstance(load, Force)
    vector = np.array(load.vector)
    return vector / np.linalg.norm(vector)
