"""The case of a designed plate: printed of prepreg filament, as the parts of Wang et al. 2021."""

from collections.abc import Callable

from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.designed.plate import DesignPlate
from ccfem.cases.stored.stored_files import mesh_of_case
from ccfem.fem.elasticity.problem import Force, Order, Problem, Support
from ccfem.fem.materials import printed_pla
from ccfem.machine.machine import Machine
from ccfem.machine.speed_table import SpeedTable
from ccfem.slicing.slicers.planar import Planar

ELEMENT_SIZE = 1.2
THICKNESS = 1.0
"""Of the plates, mm; that of the printed parts is not stated."""
_SOURCE = "Wang et al. 2021 (Composites Part A 140, 106181)"
_LAYERS = 2


def prepreg_printer() -> Machine:
    """Printer of the prepreg filament, with the speeds of table 2 of the paper.

    Strands 0.9 mm wide, no shorter than 10 mm, and turns of 1.5 mm radius are assumed: the paper
    does not state them.
    """
    return Machine(
        fibre_width=0.9,
        minimum_length=10.0,
        minimum_radius=1.5,
        speeds=SpeedTable(),
    )


def case_of(plate: Callable[..., DesignPlate], title: str) -> Callable[..., Case]:
    """Make the case of a plate, made of its force: a function of the parameters that all share."""

    def case(
        optimised: bool = True,
        element_size: float = ELEMENT_SIZE,
        order: Order = 1,
        force: float = 100.0,
        thickness: float = THICKNESS,
    ) -> Case:
        return designed_case(plate(force=force), optimised, element_size, order, thickness)

    case.__doc__ = f"{title}: optimised, or the full plate.\n\nParameters as in `designed_case`."
    return case


def designed_case(
    plate: DesignPlate,
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: Order = 1,
    thickness: float = THICKNESS,
) -> Case:
    """Make the case of one plate.

    It is printed of plain matrix, so that the virtual test adds the fibre, and stands on its face
    at z = 0 without friction, so that it stays plane.

    Parameters
    ----------
    plate : DesignPlate
        With its force.
    optimised : bool, default True
        Whether to take the optimised part, or the full plate.
    element_size, order
        As in `ccfem.cases.bar`.
    thickness : float, mm
    """
    polygon = None if optimised else plate.domain
    key = plate.name if optimised and thickness == THICKNESS else ""

    def make(size: float) -> TetMesh:
        return plate.mesh(plate.part if polygon is None else polygon, size, thickness)

    problem = Problem(
        mesh_of_case(key, element_size, order, make),
        printed_pla(),
        (
            *(Support(name, held) for name, (_, held) in plate.supports.items()),
            Support("bottom", "z"),
        ),
        {"down": (Force("load", (0.0, -plate.force, 0.0)),)},
        order=order,
    )
    what = "optimised" if optimised else "full plate"
    return Case(
        name=plate.name,
        title=f"{plate.title}, {what}",
        problem=problem,
        slicing=Planar(count=_LAYERS),
        machine=prepreg_printer(),
        source=f"{_SOURCE}: size and loading; what it does not state is assumed",
    )
