"""A plate on two corners, loaded in the middle, as topology optimisation shapes it."""

import shapely

from ccfem.cases.designed import DesignPlate, Stretch, case_of

__all__ = ["m_shape", "m_shape_plate"]


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


m_shape = case_of(m_shape_plate, "Plate on two corners (M-shape), 120 x 60 mm")
