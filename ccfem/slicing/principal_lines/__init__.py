"""Lines along the strongest principal stress of a part, and the region that carries the load."""

from ccfem.slicing.principal_lines.critical import (
    CriticalRegion,
    Strongest,
    critical_region,
    strongest_stress,
)
from ccfem.slicing.principal_lines.tracing import Traced, Tracer, trace

__all__ = [
    "CriticalRegion",
    "Strongest",
    "Traced",
    "Tracer",
    "critical_region",
    "strongest_stress",
    "trace",
]
