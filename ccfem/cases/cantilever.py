"""A cantilever beam, as topology optimisation shapes it."""

import shapely

from ccfem.cases.designed import DesignPlate, Stretch, case_of


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


cantilever = case_of(cantilever_plate, "Cantilever beam, 120 x 60 mm")
