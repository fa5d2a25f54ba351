"""Planning: strategies, the paths of a whole part, and plans of equal fibre length."""

from ccfem.paths.planning.equal_fibre import length_per_layer, plan_to_length
from ccfem.paths.planning.given_paths import GivenPaths
from ccfem.paths.planning.layer_plans import plan
from ccfem.paths.planning.strategy import Amount, LayerStrategy, PartStrategy, Planned, Strategy

__all__ = [
    "Amount",
    "GivenPaths",
    "LayerStrategy",
    "PartStrategy",
    "Planned",
    "Strategy",
    "length_per_layer",
    "plan",
    "plan_to_length",
]
