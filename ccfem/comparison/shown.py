"""Selection of the layers of a comparison that are shown, and captions of runs on them."""

import re

import numpy as np

from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.slicing.layers.layer import Layer, flat_layers


def drawn_layers(comparison: Comparison) -> list[Layer]:
    """Layers that are drawn: all flat ones, and of curved ones those that have fibre."""
    indices = {int(k) for run in comparison.succeeded for k in np.unique(run.toolpaths.layer)}
    indices |= {layer.index for layer in flat_layers(comparison.layers)}
    chosen = [layer for layer in comparison.layers if layer.index in indices]
    return chosen or list(comparison.layers)


def middle_layer(comparison: Comparison) -> Layer:
    """Middle one of the layers on which most runs lay fibre, to represent all."""
    indices = [set(np.unique(run.toolpaths.layer).tolist()) for run in comparison.succeeded]
    drawn = drawn_layers(comparison)
    runs = [sum(layer.index in planned for planned in indices) for layer in drawn]
    best = [layer for layer, count in zip(drawn, runs, strict=True) if count == max(runs)]
    return best[len(best) // 2]


def caption(run: Run, layer: Layer) -> str:
    """Key numbers of a run on one layer."""
    if run.evaluation is None:
        return ""
    values = run.evaluation.of_layer(layer.index)
    count = int(values["paths"])
    if not count:
        return "no fibre"
    amount = f"{values['fibre_length']:.0f} mm in {count} path{'s' if count > 1 else ''}"
    efficiency = values["efficiency"]
    return amount if np.isnan(efficiency) else f"{amount}, efficiency {efficiency:.2f}"


def file_stem(*names: str) -> str:
    """Name of a file made of some names, with dashes for characters that do not suit a file."""
    return "_".join(re.sub(r"[^\w.+-]+", "-", name) for name in names)
