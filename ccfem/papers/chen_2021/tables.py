"""Tables 1 and 2 of the paper beside ours."""

from collections.abc import Mapping

import numpy as np

from ccfem.papers.chen_2021.pipeline import STAGES
from ccfem.papers.chen_2021.study import Study

PAPER_1 = {
    "Loop": (32473, 12, 17.684, 0.810, 0.200, 0.030, 8.210, 0.591, 130.862),
    "Shell_Tensile": (112080, 12, 400.683, 3.262, 1.093, 0.096, 24.077, 1.225, 758.140),
    "Wrench": (14002, 12, 2.883, 0.329, 0.108, 0.016, 3.414, 0.342, 56.642),
    "Piston": (85558, 66, 215.88, 2.501, 0.246, 0.031, 6.035, 0.462, 665.953),
    "Shell_Compress": (112080, 12, 414.114, 3.117, 0.964, 0.162, 16.732, 0.935, 676.000),
}
"""Cells and layers; seconds of orientation and removal, of the stages of a layer, and of all."""
_PAPER_2 = {
    "paper: contour and zigzag": (35.895, 0.757 / 0.423),
    "paper: theirs": (34.658, 1.137 / 0.423),
}
"""Fibre, m, and slope over that of the part without fibre, of the Loop."""


def time_table(study: Study) -> str:
    """Table 1 in Markdown: the paper's rows, then ours."""
    stages = tuple(f"{stage}, s a layer" for stage in STAGES)
    heads = ("model", "cells", "layers", "orientation, s", "removal, s", *stages, "all, s")
    lines = [_row(heads), "|---" * len(heads) + "|"]
    for name, values in PAPER_1.items():
        lines.append(_row((f"paper: {name}", *(f"{value:g}" for value in values))))
    for name, model in study.models.items():
        layers = np.array([each.seconds for each in model.stages])
        times = (*model.vectors.seconds, *layers.mean(axis=0))
        whole = sum(model.vectors.seconds) + float(layers.sum())
        sizes = (str(len(model.stress.mesh.cells)), str(len(model.layers)))
        lines.append(_row((f"here: {name}", *sizes, *(f"{t:.3f}" for t in (*times, whole)))))
    return "\n".join(lines) + "\n"


def length_table(study: Study, found: Mapping[str, float]) -> str:
    """Table 2 in Markdown, of the Loop: fibre, and stiffness over that of the bare part."""
    rows = dict(_PAPER_2)
    for name, (paths, ratio) in study.compared.items():
        rows[f"here: {name}"] = (1e-3 * float(paths.lengths.sum()), ratio)
    for name in ("ours", "zigzag"):
        if f"fibre of the authors' paths, m, {name}" in found:
            rows[f"their published paths, {name}, tested here"] = (
                found[f"fibre of the authors' paths, m, {name}"],
                found[f"stiffness ratio of the authors' paths, {name}"],
            )
    lines = [_row(("Loop", "fibre, m", "stiffness ratio")), "|---|---|---|"]
    lines += [_row((name, f"{a:.2f}", f"{b:.2f}")) for name, (a, b) in rows.items()]
    return "\n".join(lines) + "\n"


def _row(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"
