"""The quantities that the paper's claims are about, and the verdicts."""

import os
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.judging.evaluation import Evaluation, evaluate
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.judging.virtual_testing.virtual_test import virtual_test
from ccfem.papers.chen_2021.authors import STATED
from ccfem.papers.chen_2021.loop import FOLDER
from ccfem.papers.chen_2021.study import Model, Study
from ccfem.papers.chen_2021.virtual_test import MATRIX_STRENGTH, authors_paths
from ccfem.papers.verdicts import Check, judged
from ccfem.paths.toolpaths import Toolpaths

EXPECTED = Path(__file__).with_name("expected.toml")
_VALLEY = (0.3, 0.7)
"""Products of vectors about eta = 0.5 that "separated" leaves few pairs between."""


def quantities(study: Study) -> dict[str, float]:
    """Every number that `expected.toml` names, as far as the run has it."""
    loop = study.loop
    found = _times(study) | _vectors(study) | _paths(study)
    for stop, turned in study.turns.items():
        at = f"at {stop:g} mm, %"
        found[f"turned by more than 10 degrees in space {at}"] = _over_ten(turned.in_space)
        found[f"turned by more than 10 degrees against the material {at}"] = _over_ten(
            turned.in_material
        )
    if os.environ.get(FOLDER) and loop.case.name == "chen_2021_loop":
        found |= _authors(loop)
    return found


def verdicts(found: dict[str, float]) -> list[Check]:
    """Judge every claim."""
    return judged(found, EXPECTED)


def agreement(model: Model) -> FloatArray:
    """Products v . v* of the oriented vectors of cells that share a face, both in tension."""
    vectors, raw = model.vectors.oriented, model.vectors.unfiltered
    pairs = model.stress.mesh.neighbours
    pairs = pairs[raw.defined[pairs].all(axis=1)]
    return np.einsum("pi,pi->p", vectors[pairs[:, 0]], vectors[pairs[:, 1]])


def _over_ten(angles: FloatArray) -> float:
    return 100.0 * float((angles > 10.0).mean())


def _times(study: Study) -> dict[str, float]:
    """Table 1."""
    found = {}
    for name, model in study.models.items():
        layers = np.array([each.seconds for each in model.stages])
        orientation, removal = model.vectors.seconds
        found[f"cells {name}"] = float(len(model.stress.mesh.cells))
        found[f"layers {name}"] = float(len(model.layers))
        found[f"seconds of orientation {name}"] = orientation
        found[f"seconds of removal {name}"] = removal
        found[f"seconds of planning {name}"] = orientation + removal + float(layers.sum())
        found[f"extraction, % of a layer {name}"] = 100.0 * float(layers[:, 2].sum() / layers.sum())
    return found


def _vectors(study: Study) -> dict[str, float]:
    """Figures 7 and 8."""
    found = {}
    for name, model in study.models.items():
        products = agreement(model)
        low, high = _VALLEY
        between = (products > low) & (products < high)
        found[f"pairs in the valley about eta, % {name}"] = 100.0 * float(between.mean())
    pulled, pushed = (study.models[name].vectors for name in ("Loop", "Loop, pushed"))
    both = pulled.unfiltered.defined & pushed.unfiltered.defined
    cosine = np.abs(np.einsum("mi,mi->m", pulled.oriented[both], pushed.oriented[both]))
    found["median angle between tension of pull and push"] = float(
        np.degrees(np.median(np.arccos(np.clip(cosine, 0.0, 1.0))))
    )
    return found


def _paths(study: Study) -> dict[str, float]:
    """Figures 5, 6, 9 and 10, and table 2."""
    loop = study.loop
    curves = sum(len(each.curves.lines()) for each in loop.stages)
    found = {
        "isocurves over paths": curves / len(loop.paths),
        "shortest path, mm": float(loop.paths.lengths.min()),
    }
    if "lifting_eye" in study.models:
        stages = study.models["lifting_eye"].stages
        lengths = [float(each.paths.lengths.sum()) for each in stages]
        changes = np.abs(np.diff(lengths)) / max(lengths)
        found["layers unlike the one below, %"] = 100.0 * float((changes > 1e-3).mean())
    by_power = {power: _judged(loop, paths) for power, paths in study.powers.items()}
    low, high = min(by_power), max(by_power)
    for power, each in by_power.items():
        found[f"fibre, m, p = {power:g}"] = 1e-3 * each.total["fibre_length"]
    found["fibre at the largest p over that at p = 0"] = (
        found[f"fibre, m, p = {high:g}"] / found[f"fibre, m, p = {low:g}"]
    )
    found["median over least spacing, largest p over p = 0"] = _spread(by_power[high]) / _spread(
        by_power[low]
    )
    with_it, without = by_power[1.0], _judged(loop, study.unprocessed)
    found["nearer than W, %"] = 100.0 * with_it.total["spacing_below"]
    found["within 10 degrees with processing, %"] = 100.0 * with_it.total["aligned_10"]
    found["within 10 degrees without processing, %"] = 100.0 * without.total["aligned_10"]
    found["curvature without over with processing"] = (
        without.total["curvature_95"] / with_it.total["curvature_95"]
    )
    for name, (paths, ratio) in study.compared.items():
        found[f"fibre, m, {name}"] = 1e-3 * float(paths.lengths.sum())
        found[f"stiffness ratio, {name}"] = ratio
    found["stiffness of the algorithm over contour_zigzag"] = (
        found["stiffness ratio, the paper's algorithm"] / found["stiffness ratio, contour_zigzag"]
    )
    return found


def _judged(model: Model, paths: Toolpaths) -> Evaluation:
    return evaluate(paths, model.layers, model.stress, model.case.machine)


def _spread(each: Evaluation) -> float:
    """Median distance to the next strand over the fifth percentile."""
    return each.total["spacing_50"] / each.total["spacing_5"]


def _authors(loop: Model) -> dict[str, float]:
    """Measure the authors' own paths for the Loop."""
    specimen = Specimen.of(loop.stress)
    found, failure = {}, {}
    for name in STATED:
        paths = authors_paths(name)
        found[f"fibre of the authors' paths, m, {name}"] = 1e-3 * float(paths.lengths.sum())
        tested = virtual_test(paths, specimen, span=())
        found[f"stiffness ratio of the authors' paths, {name}"] = tested.ratio
        failure[name] = first_failure(tested, matrix_strength=MATRIX_STRENGTH).load
    ratio = "stiffness ratio of the authors' paths"
    found["stiffness of the authors' paths over their zigzag"] = (
        found[f"{ratio}, ours"] / found[f"{ratio}, zigzag"]
    )
    found["first failure of the authors' paths over their zigzag"] = (
        failure["ours"] / failure["zigzag"]
    )
    return found
