"""A plate on two corners, pulled down at the middle of its bottom, as an optimisation shapes it.

An arch is pressed, and what hangs from it is pulled: both families of the paper's figure 15.
"""

import shapely

from ccfem.cases.designed import DesignPlate, Stretch, case_of


def m_shape_plate(volume_fraction: float = 0.3, force: float = 100.0) -> DesignPlate:
    """Plate 120 x 60 mm, fixed on 5 mm at both lower corners, pulled down on 4 mm between them."""
    return DesignPlate(
        name="m_shape",
        title="M-shape 120 x 60 mm, pulled down at the middle of its bottom",
        border=shapely.box(0.0, 0.0, 120.0, 60.0),
        supports={
            "support_left": (Stretch((0.0, 0.0), (5.0, 0.0)), "xy"),
            "support_right": (Stretch((115.0, 0.0), (120.0, 0.0)), "xy"),
        },
        load=Stretch((58.0, 0.0), (62.0, 0.0)),
        volume_fraction=volume_fraction,
        force=force,
        mirror="x",
    )


m_shape = case_of(m_shape_plate, "Plate on two corners (M-shape), 120 x 60 mm")
