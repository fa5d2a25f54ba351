"""The Loop of Chen et al. 2021, on the authors' own mesh.

The mesh and the published toolpaths carry the authors' rights and are no part of this project: the
folder that holds them (with ``Loop`` and ``bar`` in it) is named by the environment variable
``CCFEM_CHEN2021``.
"""

import os
from pathlib import Path

import numpy as np

from ccfem.cases.case import Case
from ccfem.elasticity.problem import Force, Problem, Support
from ccfem.errors import InputError
from ccfem.materials import isotropic
from ccfem.mesh import TetMesh

__all__ = ["FOLDER", "LAYERS_PUBLISHED", "LAYERS_TABLE_2", "authors_folder", "authors_loop"]

FOLDER = "CCFEM_CHEN2021"
"""Environment variable that names the authors' folder."""

LAYERS_PUBLISHED = 20
"""Layers in the authors' files of the Loop, at heights 0.25 + 0.5 i mm."""

LAYERS_TABLE_2 = 12
"""Layers that the paper's Table 2 counts: the first ones of the files."""

_HOLES = {"support": (-50.0, -1.0), "load": (50.0, 1.0)}
"""Height of each hole's axis along the mesh's z, and the sign of its outer half."""


def authors_folder() -> Path:
    """Folder of the authors' data.

    Raises
    ------
    InputError
        When the environment variable is unset or names no folder.
    """
    folder = os.environ.get(FOLDER, "")
    if not folder or not Path(folder).is_dir():
        raise InputError(
            f"expected {FOLDER} to name the folder with the authors' Loop and bar; got "
            f"'{folder}': set it"
        )
    return Path(folder)


def authors_loop(layers: int = LAYERS_TABLE_2) -> Case:
    """Loop pulled at its holes: E 3500 MPa, nu 0.35, 1 kN.

    The outer half of the bottom hole's wall is fixed, the outer half of the top hole's wall is
    pulled along the mesh's z; the build direction is the mesh's y.

    Parameters
    ----------
    layers : int, default 12
        Layers spread evenly over the height of 10 mm; 20 gives the heights of the authors' files.
    """
    mesh = read_tet(authors_folder() / "Loop" / "Loop.tet")
    mesh = mesh.with_patches({name: _outer_half(mesh, *hole) for name, hole in _HOLES.items()})
    problem = Problem(
        mesh=mesh,
        material=isotropic(3500.0, 0.35, name="PLA of the Loop benchmark"),
        supports=(Support("support"),),
        loads={"pull": (Force("load", (0.0, 0.0, 1000.0)),)},
    )
    return Case(
        name="chen_2021_loop",
        title="Loop of Chen et al. 2021 on the authors' mesh, pulled at its holes with 1 kN",
        problem=problem,
        build=(0.0, 1.0, 0.0),
        layers=layers,
        source="Chen, Fang, Liao, Wang, Additive Manufacturing 49 (2021) 102470",
    )


def read_tet(path: Path) -> TetMesh:
    """Read a ``.tet`` file: counts of vertices and cells, coordinates, ``4 a b c d`` lines."""
    lines = path.read_text().splitlines()
    vertices, cells = int(lines[0].split()[0]), int(lines[1].split()[0])
    points = np.array([line.split() for line in lines[2 : 2 + vertices]], dtype=np.float64)
    table = lines[2 + vertices : 2 + vertices + cells]
    corners = np.array([line.split()[1:5] for line in table], dtype=np.int64)
    inverted = TetMesh(points, corners).volumes < 0.0
    corners[inverted] = corners[inverted][:, [0, 2, 1, 3]]
    return TetMesh(points, corners)


def _outer_half(mesh: TetMesh, z: float, sign: float) -> np.ndarray:
    """Facets of one hole's wall whose centroid lies beyond the axis of the hole."""
    corners = mesh.points[mesh.boundary]
    radius = np.hypot(corners[..., 0] + 0.2, corners[..., 2] - z)
    flat = (corners[..., 1] < 0.05).all(axis=1) | (corners[..., 1] > 9.95).all(axis=1)
    outer = sign * (corners[..., 2].mean(axis=1) - z) > 0.0
    return mesh.boundary[(radius < 5.45).all(axis=1) & ~flat & outer]
