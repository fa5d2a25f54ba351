"""The parameters that SIMP and SOMP share."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ccfem.errors import InputError

__all__ = ["Parameters"]

_Filter = Literal["sensitivity", "density"]


@dataclass(frozen=True)
class Parameters:
    """What is optimised for, and when the iterations stop: see `Simp` for each of them."""

    volume_fraction: float
    penalty: float = 3.0
    radius: float = 2.5
    filter: _Filter = "sensitivity"
    minimum_stiffness: float = 1e-9
    move: float = 0.2
    tolerance: float = 0.01
    objective_tolerance: float = 1e-4
    max_iterations: int = 200
    backend: str = "auto"

    def __post_init__(self) -> None:
        expected = {
            "volume_fraction": (0.0 < self.volume_fraction < 1.0, "in (0, 1)"),
            "penalty": (1.0 <= self.penalty < np.inf, "at least 1"),
            "radius": (0.0 < self.radius < np.inf, "above 0 mm"),
            "filter": (self.filter in get_args(_Filter), f"one of {', '.join(get_args(_Filter))}"),
            "minimum_stiffness": (0.0 < self.minimum_stiffness < 1.0, "in (0, 1)"),
            "move": (0.0 < self.move <= 1.0, "in (0, 1]"),
            "tolerance": (self.tolerance >= 0.0, "at least 0"),
            "objective_tolerance": (self.objective_tolerance >= 0.0, "at least 0"),
            "max_iterations": (self.max_iterations >= 1, "at least 1"),
        }
        for name, (kept, rule) in expected.items():
            if not kept:
                raise InputError(f"{name} must be {rule}; got {getattr(self, name)!r}: correct it")
