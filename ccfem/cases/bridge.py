"""A bridge in three-point bending, as topology optimisation shapes it."""

import shapely

from ccfem.cases.designed import DesignPlate, Stretch, case_of


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


bridge = case_of(bridge_plate, "Bridge in three-point bending, 185 x 50 mm")
