"""A suspension arm: a column with a cantilever and two holes, as optimisation shapes it."""

import shapely

from ccfem.cases.case import Case
from ccfem.cases.designed import (
    ELEMENT_SIZE,
    THICKNESS,
    DesignPlate,
    Hole,
    Stretch,
    designed_case,
    designed_mesh,
)
from ccfem.mesh import TetMesh

__all__ = ["suspension", "suspension_mesh", "suspension_plate"]


def suspension_plate(volume_fraction: float = 0.4, force: float = 100.0) -> DesignPlate:
    """Column 60 mm wide with an arm at its top, 175 x 126 mm, pressed on the end of the arm.

    Fixed at its bottom. Holes of radius 8 mm lie at (30, 25) and (150, 108); the one in the arm
    keeps a rim of 3 mm.
    """
    return DesignPlate(
        name="suspension",
        title="Suspension 175 x 126 mm with two holes, pressed down on its arm",
        border=shapely.union(
            shapely.box(0.0, 0.0, 60.0, 126.0), shapely.box(0.0, 90.0, 175.0, 126.0)
        ),
        supports={"support": (Stretch((0.0, 0.0), (60.0, 0.0)), "xy")},
        load=Stretch((170.0, 126.0), (175.0, 126.0)),
        volume_fraction=volume_fraction,
        holes=(Hole(30.0, 25.0, 8.0), Hole(150.0, 108.0, 8.0, rim=3.0)),
        force=force,
        radius=3.0,
    )


def suspension_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part."""
    return designed_mesh(suspension_plate(), element_size)


def suspension(
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: int = 1,
    force: float = 100.0,
    thickness: float = THICKNESS,
) -> Case:
    """Suspension arm with holes, 175 x 126 mm: optimised, or the full plate.

    Parameters
    ----------
    optimised : bool, default True
        Whether to take the optimised part, or the full plate.
    element_size : float, mm
        Edge length of the cells aimed at.
    order : {1, 2}
        Linear or quadratic cells.
    force : float, N
    thickness : float, mm
    """
    return designed_case(suspension_plate(force=force), optimised, element_size, order, thickness)
