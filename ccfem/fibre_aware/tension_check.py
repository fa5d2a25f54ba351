"""Whether a part has tension that fibre can carry."""

from collections.abc import Sequence

import numpy as np

from ccfem.elasticity.part_stress import PartStress
from ccfem.errors import InputError
from ccfem.fields.layer_tension import layer_tension
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import stress_on

__all__ = ["check_tension"]


def check_tension(stresses: Sequence[PartStress], layers: Sequence[Layer]) -> None:
    """Refuse a part that is under tension nowhere, in no load case."""
    for stress in stresses:
        if any(layer_tension(stress_on(layer, stress)).defined.any() for layer in layers):
            return
    largest = max(float(np.linalg.eigvalsh(stress.stress).max()) for stress in stresses)
    raise InputError(
        "expected tension that fibre can carry; the largest tensile stress found is "
        f"{largest:.3g} MPa, outweighed by compression: turn the load round"
    )
