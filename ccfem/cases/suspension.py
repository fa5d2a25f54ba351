"""A suspension arm: a column with a cantilever and two holes, as optimisation shapes it."""

import shapely

from ccfem.cases.designed import DesignPlate, Hole, Stretch, case_of


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


suspension = case_of(suspension_plate, "Suspension arm with holes, 175 x 126 mm")
