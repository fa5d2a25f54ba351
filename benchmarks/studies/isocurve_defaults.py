"""Which defaults of isocurve make the stiffest parts: a sweep at equal fibre length.

    python benchmarks/studies/isocurve_defaults.py

One parameter at a time is moved away from the defaults; the amount of fibre is held by the cap of
the stress (`Isocurve.amount`). For each case: predicted stiffness over the unreinforced part
(fibres carry tension only, rho 4 mm^2) and predicted first-failure load, then their geometric
means over the cases, relative to the defaults. Rows are written as they are found.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.cases import create_case
from ccfem.fem.elasticity import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.machine import Machine
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.slicing.layers import Layer
from ccfem.strategies.isocurve import Isocurve

FIBRE_PER_LAYER = {"loop": 2600.0, "bar": 380.0, "open_hole": 4500.0}
"""Fibre, mm a layer: somewhat less than the natural length of the defaults."""

SWEEP: dict[str, tuple[Any, ...]] = {
    "cap": (80.0, 92.0),
    "floor": (0.0, 0.2, 0.4, 0.5, 0.7, 0.8),
    "power": (0.0, 0.5, 0.7, 1.5),
    "spacing_weight": (0.03, 0.2, 0.4, 1.0),
    "fill_length": (0.7, 2.5, 4.0),
    "link_limit": (0.0, 2.0, 4.0, 10.0),
    "conformal": ("loaded",),
    "spiral": (False,),
    "spacing": ("search",),
}


@dataclass(frozen=True)
class Part:
    """A solved and sliced case."""

    name: str
    field: StressField
    layers: tuple[Layer, ...]
    machine: Machine
    specimen: Specimen

    @classmethod
    def of(cls, name: str) -> "Part":
        """Solve and slice a case by name."""
        case = create_case(name)
        field = next(iter(solve(case.problem).values()))
        layers = case.slicing(field, case.build, case.machine)
        return cls(name, field, layers, case.machine, Specimen.of(field))


def score(strategy: Isocurve, part: Part) -> tuple[float, float, float]:
    """Stiffness ratio, first-failure load in N, and fibre in mm a layer."""
    wanted = FIBRE_PER_LAYER[part.name]
    paths = plan_to_length(strategy, part.layers, part.field, part.machine, wanted).toolpaths
    test = virtual_test(paths, part.specimen, span=())
    return test.ratio, first_failure(test).load, float(paths.lengths.sum()) / len(part.layers)


def variants() -> Iterator[Mapping[str, Any]]:
    """Yield the defaults, then one changed parameter at a time."""
    yield {}
    for name, values in SWEEP.items():
        for value in values:
            yield {name: value}


def main() -> None:
    """Print the table."""
    parts = [Part.of(name) for name in FIBRE_PER_LAYER]
    print(f"{'':26}" + "".join(f"{part.name:>28}" for part in parts) + "   mean T  mean load")
    base: np.ndarray | None = None
    for changed in variants():
        found = np.array([score(Isocurve(**changed), part) for part in parts])
        base = found if base is None else base
        mean = np.exp(np.log(found[:, :2] / base[:, :2]).mean(axis=0))
        cells = "".join(f"   {t:6.3f} {load:7.0f} N {mm:5.0f} mm" for t, load, mm in found)
        name = ", ".join(f"{k} {v}" for k, v in changed.items()) or "defaults"
        print(f"{name:26}{cells}   {mean[0]:6.4f}  {mean[1]:6.4f}", flush=True)


if __name__ == "__main__":
    main()
