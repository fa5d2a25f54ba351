"""A plate on two corners, loaded in the middle, as topology optimisation shapes it."""

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

__all__ = ["m_shape", "m_shape_mesh", "m_shape_plate"]


def m_shape_plate(volume_fraction: float = 0.4, force: float = 100.0) -> DesignPlate:
    """Plate 120 x 60 mm, fixed on 5 mm at both lower corners, pressed on 4 mm of its top."""
    return DesignPlate(
        name="m_shape",
        title="M-shape 120 x 60 mm, pressed down at the middle of its top",
        border=shapely.box(0.0, 0.0, 120.0, 60.0),
        supports={
            "support_left": (Stretch((0.0, 0.0), (5.0, 0.0)), "xy"),
            "support_right": (Stretch((115.0, 0.0), (120.0, 0.0)), "xy"),
        },
        load=Stretch((58.0, 60.0), (62.0, 60.0)),
        volume_fraction=volume_fraction,
        force=force,
        mirror="x",
    )


def m_shape_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part."""
    return designed_mesh(m_shape_plate(), element_size)


def m_shape(
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: int = 1,
    force: float = 100.0,
    thickness: float = THICKNESS,
) -> Case:
    """Plate on two corners, 120 x 60 mm, pressed down: optimised (M-shape), or full.

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
    return designed_case(m_shape_plate(force=force), optimised, element_size, order, thickness)
