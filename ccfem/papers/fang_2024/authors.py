"""The authors' T-bracket: the solid recovered from their layers, the layers, and the strands."""

import os
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.bisection import bisected
from ccfem.body.mesh.patches import patches_from_rules
from ccfem.cases.bodies import T_BRACKET_HOLES
from ccfem.fem.elasticity import PartStress, Problem, StressField, solve
from ccfem.fem.elasticity.problem import Bearing, Support
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.robot_waypoints import read_layer_waypoints
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.surfaces import Surfaces


def authors_folder() -> Path:
    """Folder of the published data, named by ``CCFEM_FANG2024``."""
    named = os.environ.get("CCFEM_FANG2024")
    if not named:
        raise InputError("set CCFEM_FANG2024 to the folder of the data of Fang et al. 2024")
    return Path(named)


def authors_mesh() -> TetMesh:
    """84,056 tetrahedra with the walls of the holes as patches."""
    with np.load(authors_folder() / "TBracket-solid.npz") as archive:
        mesh = TetMesh(archive["V"], archive["T"])
    return patches_from_rules(mesh, T_BRACKET_HOLES)


def finer_mesh() -> TetMesh:
    """About 170 thousand cells: the largest ones of `authors_mesh` halved, and those about them."""
    mesh = authors_mesh()
    return bisected(mesh, mesh.volumes > np.quantile(mesh.volumes, 0.64))[0]


def authors_stress(mesh: TetMesh, force: float = 1000.0, order: int = 2) -> StressField:
    """Walls of the base's holes fixed, a bolt pulling the head: quadratic cells, PLA."""
    problem = Problem(
        mesh.quadratic() if order == 2 else mesh,
        isotropic(3000.0, 0.35),
        (Support("base_left"), Support("base_right")),
        {"pull": (Bearing("pull", (0.0, force, 0.0)),)},
        order="auto" if order == 2 else 1,
    )
    return solve(problem)["pull"]


def authors_layers(stress: PartStress) -> tuple[Layer, ...]:
    """Read the 59 published layers."""
    slicer = Surfaces(str(authors_folder() / "TBracket" / "matrixLayer"), thickness=0.53)
    return slicer(stress, (0.0, 1.0, 0.0), Machine())


def authors_strands(layers: tuple[Layer, ...]) -> Toolpaths:
    """Read the published strands, each on the layer that it lies nearest to.

    The numbers of their files and of the layers' do not correspond.
    """
    from scipy.spatial import cKDTree

    trees = [cKDTree(layer.points) for layer in layers]
    parts = []
    folder = authors_folder() / "TBracket" / "toolpath"
    for file in sorted(folder.glob("*.txt"), key=lambda path: int(path.stem)):
        sample = np.loadtxt(file)[::20, :3]
        away = [float(np.median(tree.query(sample)[0])) for tree in trees]
        parts.append(read_layer_waypoints(file, layers[int(np.argmin(away))]))
    return Toolpaths.concatenate(parts)
