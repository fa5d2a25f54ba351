"""The claims of the paper beside ours: every quantity is computed from a run."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ccfem.papers.kipping_2023.chain import PAPER_SECONDS, Chain
from ccfem.papers.kipping_2023.fiso_shapes import Strand
from ccfem.papers.kipping_2023.thickness import distances_below
from ccfem.papers.verdicts import Check, judged
from ccfem.printing.support import support_columns
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.load_oriented import LoadOriented

EXPECTED = Path(__file__).with_name("expected.toml")


def quantities(
    chains: Mapping[str, Chain],
    trades: Mapping[str, Mapping[str, Mapping[str, float]]],
    loads: Mapping[str, Mapping[str, tuple[float, ...]]],
    strands: Mapping[tuple[str, bool], Strand],
) -> dict[str, float]:
    """Every quantity that `expected.toml` may name."""
    found: dict[str, float] = {}
    for part, run in chains.items():
        found |= {f"{part}: seconds, {name}": value for name, value in run.seconds.items()}
        found[f"{part}: time over the paper's"] = run.seconds["all"] / PAPER_SECONDS[part]
        found[f"{part}: inverted"] = run.sliced.inverted
        found[f"{part}: thickness"] = run.distances.mean
        found[f"{part}: with a layer below"] = run.distances.covered
        found[f"{part}: paths"] = float(len(run.paths))
        layers = len(np.unique(run.paths.layer))
        found[f"{part}: layers with paths"] = float(layers)
        found |= {f"{part}: support, {name}": v for name, v in _support(run).items()}
        for name, figures in trades[part].items():
            found |= {f"{part}, {name}: {key}": value for key, value in figures.items()}
    for part, each in loads.items():
        flat, ours = each["flat, z"], each["load-oriented"]
        found[f"{part}: failure load over flat"] = ours[0] / flat[0]
        found[f"{part}: failure load over flat, bond strong in shear"] = ours[3] / flat[3]
        found[f"{part}: failure load over flat, by opening"] = ours[6] / flat[6]
    found["strands: most paths"] = float(max(s.paths for s in strands.values()))
    found["strands: least coverage"] = min(s.coverage for s in strands.values())
    found["strands: least coverage, opened"] = min(s.coverage_opened for s in strands.values())
    found["strands: crossings"] = float(sum(s.crossings for s in strands.values()))
    found["strands: longest step"] = max(s.longest_step for s in strands.values())
    return found


def _support(run: Chain) -> dict[str, float]:
    """Figures of the layers below a part."""
    support, slicer = run.support, run.case.slicing
    assert isinstance(slicer, LoadOriented)
    node = support.columns.node
    shared = node >= 0
    jump = np.abs(support.field.values[shared] - run.sliced.field.values[node[shared]])
    lowest = support.layers[0]
    tilt = np.degrees(np.arccos(np.clip(lowest.normals @ run.sliced.field.up, -1.0, 1.0)))
    distances = distances_below(support.layers)
    both: list[Layer] = []
    judged: list[bool] = []
    for k, layer in enumerate(run.sliced.layers):
        before = support.layers_before(k)
        both += [*before, layer]
        judged += [False] * len(before) + [True]
    return {
        "layers": float(len(support.layers)),
        "mm^3": support.columns.volume,
        "contact mm^2": support.columns.contact,
        "jump in layers": float(jump.max()) / run.sliced.step,
        "tilt of the lowest": float(np.average(tilt, weights=lowest.areas)),
        "inverted": support.field.inverted,
        "in range": distances.within(slicer.thinnest, slicer.thickest),
        "thickness": distances.mean,
        "part with a layer below": distances_below(both, judged).covered,
    }


def support_table(chains: Mapping[str, Chain]) -> str:
    """Table of the support of each part: layers along the stress, and flat ones that carry 45."""
    head = "| part | layers | mm^3 | contact mm^2 | part mm^3 | number | 0.2 to 0.5 mm | inverted |"
    lines = [head, "|---" * 8 + "|"]
    for part, run in chains.items():
        mesh, own = run.stress.mesh, _support(run)
        flat = support_columns(mesh, angle=45.0)
        lines += [
            f"| {part} | load-oriented | {own['mm^3']:.0f} | {own['contact mm^2']:.0f} | "
            f"{mesh.volumes.sum():.0f} | {own['layers']:.0f} | {own['in range']:.1%} | "
            f"{own['inverted']:.2%} |",
            f"| {part} | flat, over 45 degrees | {flat.volume:.0f} | {flat.contact:.0f} | "
            f"{mesh.volumes.sum():.0f} | | | |",
        ]
    return "\n".join(lines) + "\n"


def verdicts(found: Mapping[str, float]) -> list[Check]:
    """Judge the claims by the quantities found."""
    return judged(found, EXPECTED)
