"""How the axis of SOMP is turned best: ``python -m benchmarks.orientation``.

Compliance of the optimised plates of Wang et al. 2021, of all densities and of the densest cells
alone, with the axis along the principal stress and down the gradient, and the iterations taken.
"""

import numpy as np

from ccfem.cases.designed import LAMINATE, PLATES
from ccfem.fem.topopt import Compliance, Somp


def main() -> None:
    """Print the table."""
    print("| plate | way | compliance, N mm | of the densest cells | iterations |")
    print("|---|---|---|---|---|")
    for name, plate in PLATES.items():
        for way in ("principal", "gradient"):
            radius = plate.radius * plate.pixel
            method = Somp(plate.volume_fraction, radius=radius, orientation=way)
            design = method(plate.problem, LAMINATE, solid=plate.rims)
            full = np.where(design.filled(plate.volume_fraction), 1.0, 1e-3)
            black = Compliance(design.full)(full).compliance
            figures = f"{design.compliance[-1]:.4g} | {black:.4g} | {design.iterations}"
            print(f"| {name} | {way} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
