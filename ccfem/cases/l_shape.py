"""An L-shaped bracket, as topology optimisation shapes it."""

import shapely

from ccfem.cases.designed import DesignPlate, Stretch, case_of


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


l_shape = case_of(l_shape_plate, "L-shaped bracket, 100 x 100 mm")
