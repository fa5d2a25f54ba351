"""An L-shaped bracket, as topology optimisation shapes it."""

import shapely

from ccfem.cases.case import Case
from ccfem.cases.designed import (
    ELEMENT_SIZE,
    THICKNESS,
    DesignPlate,
    Stretch,
    designed_case,
    designed_mesh,
)
from ccfem.mesh import TetMesh

__all__ = ["l_shape", "l_shape_mesh", "l_shape_plate"]


def l_shape_plate(volume_fraction: float = 0.4, force: float = 100.0) -> DesignPlate:
    """L of 100 x 100 mm, 40 mm wide, fixed at its top, loaded on 4 mm of its right side."""
    return DesignPlate(
        name="l_shape",
        title="L-shape 100 x 100 mm, fixed at its top, loaded on its right",
        border=shapely.box(0.0, 0.0, 100.0, 100.0).difference(
            shapely.box(40.0, 40.0, 100.0, 100.0)
        ),
        supports={"support": (Stretch((0.0, 100.0), (40.0, 100.0)), "xy")},
        load=Stretch((100.0, 18.0), (100.0, 22.0)),
        volume_fraction=volume_fraction,
        force=force,
    )


def l_shape_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part."""
    return designed_mesh(l_shape_plate(), element_size)


def l_shape(
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: int = 1,
    force: float = 100.0,
    thickness: float = THICKNESS,
) -> Case:
    """L-shaped bracket, 100 x 100 mm: optimised, or the full plate.

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
    return designed_case(l_shape_plate(force=force), optimised, element_size, order, thickness)
