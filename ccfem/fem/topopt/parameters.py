"""The parameters that SIMP and SOMP share."""

from dataclasses import dataclass
from typing import Literal

from ccfem.base.checks import check_choices, check_fields


@dataclass(frozen=True)
class Parameters:
    """What is optimised for, and when the iterations stop: see `Simp` for each of them."""

    volume_fraction: float
    penalty: float = 3.0
    radius: float = 2.5
    filter: Literal["sensitivity", "density"] = "sensitivity"
    minimum_stiffness: float = 1e-9
    move: float = 0.2
    tolerance: float = 0.01
    objective_tolerance: float = 1e-4
    max_iterations: int = 200
    backend: str = "auto"

    def __post_init__(self) -> None:
        check_fields(self, "volume_fraction", "minimum_stiffness", above=0.0, below=1.0)
        check_fields(self, "penalty", "max_iterations", at_least=1)
        check_fields(self, "radius", above=0.0, unit="mm")
        check_fields(self, "move", above=0.0, at_most=1.0)
        check_fields(self, "tolerance", "objective_tolerance", at_least=0.0)
        check_choices(self)
