"""What the layers are worth: load at which they come apart, flat beside load-oriented."""

from collections.abc import Sequence

import numpy as np

from benchmarks.papers.kipping_2023.chain import Chain
from ccfem.layers.layer import Layer
from ccfem.layers.slicing import Planar
from ccfem.materials import isotropic
from ccfem.virtual_testing.interlayer import interlayer

__all__ = ["SHEAR", "failure_loads", "strength_table"]

SHEAR = (18.0, 35.0)
"""Strength of the bond of printed PLA along layers, MPa: as low as across them, and as published;
18 MPa across."""


def failure_loads(run: Chain) -> dict[str, tuple[float, ...]]:
    """Load, N, at which layers come apart outside 3, 1.5 and 0 mm from the bolts, by slicing.

    Three loads for each of `SHEAR`. The part is without fibre: what the layers alone are worth.
    All are judged by one stress.
    """
    mesh, force = run.stress.mesh, 100.0
    found: dict[str, tuple[float, ...]] = {}
    best = tuple(float(x) for x in run.sliced.best)
    slicings: dict[str, Sequence[Layer]] = {
        "flat, z": Planar(thickness=0.35).cut(mesh, (0.0, 0.0, 1.0)),
        "flat, best plane": Planar(thickness=0.35).cut(mesh, best),
        "load-oriented": run.sliced.layers,
    }
    for name, layers in slicings.items():
        told: list[float] = []
        for shear in SHEAR:
            bond = {"interlayer_tensile": 18.0, "interlayer_shear": shear}
            judged = interlayer(run.stress, layers, isotropic(3500.0, 0.35, **bond))
            told += [force / max(index, 1e-12) for index in judged.zone_indices]
        found[name] = tuple(told)
    return found


def strength_table(loads: dict[str, dict[str, tuple[float, ...]]]) -> str:
    """Table in Markdown, by part and slicing."""
    zones = "3 mm off the bolts | 1.5 mm | 0 mm"
    head = (
        f"| part | layers | S 18 MPa: {zones} | S 35 MPa: {zones} | over flat | S 35: over flat |"
    )
    lines = [head, "|---" * 10 + "|"]
    for part, found in loads.items():
        flat = np.array(found["flat, z"])
        for name, values in found.items():
            told = " | ".join(f"{value:.0f} N" for value in values)
            gain = " | ".join(f"{values[k] / flat[k]:.2f}" for k in (0, 3))
            lines.append(f"| {part} | {name} | {told} | {gain} |")
    return "\n".join(lines) + "\n"
