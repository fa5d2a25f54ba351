"""A cantilever beam, as topology optimisation shapes it."""

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

__all__ = ["cantilever", "cantilever_mesh", "cantilever_plate"]


def cantilever_plate(volume_fraction: float = 0.5, force: float = 100.0) -> DesignPlate:
    """Plate 120 x 60 mm, fixed on the left, loaded on 4 mm in the middle of the right side."""
    return DesignPlate(
        name="cantilever",
        title="Cantilever 120 x 60 mm, fixed on its left, loaded on its right",
        border=shapely.box(0.0, 0.0, 120.0, 60.0),
        supports={"support": (Stretch((0.0, 0.0), (0.0, 60.0)), "xy")},
        load=Stretch((120.0, 28.0), (120.0, 32.0)),
        volume_fraction=volume_fraction,
        force=force,
        mirror="y",
    )


def cantilever_mesh(element_size: float) -> TetMesh:
    """Mesh of the optimised part."""
    return designed_mesh(cantilever_plate(), element_size)


def cantilever(
    optimised: bool = True,
    element_size: float = ELEMENT_SIZE,
    order: int = 1,
    force: float = 100.0,
    thickness: float = THICKNESS,
) -> Case:
    """Cantilever beam, 120 x 60 mm: optimised, or the full plate.

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
    return designed_case(cantilever_plate(force=force), optimised, element_size, order, thickness)
