"""A bridge in three-point bending, as topology optimisation shapes it."""

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

__all__ = ["bridge", "bridge_mesh", "bridge_plate"]


def bridge_plate(volume_fraction: float = 0.4, force: float = 100.0) -> DesignPlate:
    """Plate 185 x 50 mm on two supports of 5 mm, pressed on 5 mm in the middle of its top.

    The left support holds x and y, the right one y.
    """
    return DesignPlate(
        name="bridge",
        title="Bridge 185 x 50 mm, pressed down at the middle of its top",
        border=shapely.box(0.0, 0.0, 185.0, 50.0),
        supports={
            "support_left": (Stretch((0.0, 0.0), (5.0, 0.0)), "xy"),
            "support_right": (Stretch((180.0, 0.0), (185.0, 0.0)), "y"),
        },
        load=Stretch((90.0, 50.0), (95.0, 50.0)),
        volume_fraction=volume_fraction,
        force=force,
        mirror="x",
    )


def bridge_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part."""
    return designed_mesh(bridge_plate(), element_size)


def bridge(
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: int = 1,
    force: float = 100.0,
    thickness: float = THICKNESS,
) -> Case:
    """Bridge in three-point bending, 185 x 50 mm: optimised, or the full plate.

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
    return designed_case(bridge_plate(force=force), optimised, element_size, order, thickness)
