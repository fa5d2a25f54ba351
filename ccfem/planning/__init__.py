"""Planning: strategies, the paths of a whole part, and plans of equal fibre length."""

from ccfem.planning.equal_fibre import Planned, length_per_layer, plan_to_length
from ccfem.planning.given_paths import GivenPaths
from ccfem.planning.plan import plan
from ccfem.planning.strategy import Amount, LayerStrategy, PartStrategy, Strategy

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
