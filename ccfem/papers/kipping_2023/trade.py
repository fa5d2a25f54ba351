"""What flatter layers cost: tension across layers over the blend, and the paper's own choices."""

from dataclasses import replace
from typing import Any

import numpy as np

from ccfem.comparison.plot.canvas import png
from ccfem.papers.kipping_2023.chain import Chain
from ccfem.papers.kipping_2023.figures import blank
from ccfem.papers.kipping_2023.thickness import distances_below
from ccfem.slicing.slicers.load_oriented import LoadOriented

VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "blend 0.25": {"blend": 0.25},
    "blend 0.5": {"blend": 0.5},
    "blend 1": {"blend": 1.0},
    "blend 2": {"blend": 2.0},
    "no gap filter": {"gap": 0.0},
    "blend alone": {"even": False},
    "as published": {"quantile": 1.0, "gap": 0.0, "blend": 0.0, "even": False},
}
"""Parameters of `LoadOriented`."""

COLUMNS = ("tension", "below z", "below the best plane", "angle", "tilt", "inverted", "in range")


def trade(run: Chain) -> dict[str, dict[str, float]]:
    """Figures of the variants by name: `COLUMNS`."""
    slicer = run.case.slicing
    assert isinstance(slicer, LoadOriented)
    found = {}
    for name, given in VARIANTS.items():
        sliced = run.sliced if name == "default" else replace(slicer, **given).slice(run.stress)
        across = sliced.across.tension
        gradient = sliced.field.gradient
        cosine = gradient @ sliced.field.up / np.linalg.norm(gradient, axis=1)
        tilt = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        found[name] = {
            "tension": across,
            "below z": 1.0 - across / sliced.across_build.tension,
            "below the best plane": 1.0 - across / sliced.across_best.tension,
            "angle": sliced.across.angle,
            "tilt": float(np.average(tilt, weights=run.stress.mesh.volumes)),
            "inverted": sliced.inverted,
            "in range": distances_below(sliced.layers).within(slicer.thinnest, slicer.thickest),
            "blend": sliced.field.blend,
        }
    return found


def trade_table(found: dict[str, dict[str, dict[str, float]]]) -> str:
    """Table in Markdown, by part and variant."""
    lines = [f"| part | variant | {' | '.join(COLUMNS)} |", "|---" * (len(COLUMNS) + 2) + "|"]
    for part, variants in found.items():
        for name, figures in variants.items():
            values = " | ".join(f"{figures[column]:.4g}" for column in COLUMNS)
            lines.append(f"| {part} | {name} | {values} |")
    return "\n".join(lines) + "\n"


def trade_picture(found: dict[str, dict[str, dict[str, float]]]) -> bytes:
    """Draw the tension across layers over the blend."""
    figure = blank(6.0, 4.0)
    axes = figure.subplots()
    for part, variants in found.items():
        rows = [v for name, v in variants.items() if set(VARIANTS[name]) <= {"blend"}]
        rows = sorted((v for v in rows if v["inverted"] == 0.0), key=lambda v: v["blend"])
        axes.plot([v["blend"] for v in rows], [v["tension"] for v in rows], "o-", label=part)
    axes.set_xlabel("blend")
    axes.set_ylabel("share of the tension across layers")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    return png(figure)
