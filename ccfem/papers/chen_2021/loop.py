"""The Loop of Chen et al. 2021, on the authors' own mesh.

The mesh and the published toolpaths carry the authors' rights and are no part of this project: the
folder that holds them (with ``Loop`` and ``bar`` in it) is named by the environment variable
``CCFEM_CHEN2021``.
"""

import os
from pathlib import Path

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.cases.case import Case
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.slicing.slicers.planar import Planar

FOLDER = "CCFEM_CHEN2021"
"""Environment variable that names the authors' folder."""

LAYERS_PUBLISHED = 20
"""Layers in the authors' files of the Loop, at heights 0.25 + 0.5 i mm."""

LAYERS_TABLE_2 = 12
"""Layers that the paper's Table 2 counts: the first ones of the files."""

HOLES = {
    "support": Cylinder((-0.2, 5.0, -50.0), "y", radius=5.0, tolerance=0.45, half="-z"),
    "load": Cylinder((-0.2, 5.0, 50.0), "y", radius=5.0, tolerance=0.45, half="z"),
}
"""Outer half of the wall of each hole; the walls' nodes lie up to 5.02 mm from the axes."""


def authors_folder() -> Path:
    """Folder of the authors' data."""
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
    mesh = patches_from_rules(read_mesh(authors_folder() / "Loop" / "Loop.tet"), HOLES)
    problem = Problem(
        mesh=mesh,
        material=isotropic(3500.0, 0.35, name="PLA of the Loop benchmark"),
        supports=(Support("support"),),
        loads={"pull": (Force("load", (0.0, 0.0, 1000.0)),)},
        order=1,
    )
    return Case(
        name="chen_2021_loop",
        title="Loop of Chen et al. 2021 on the authors' mesh, pulled at its holes with 1 kN",
        problem=problem,
        build=(0.0, 1.0, 0.0),
        slicing=Planar(count=layers),
        source="Chen, Fang, Liao, Wang, Additive Manufacturing 49 (2021) 102470",
    )
