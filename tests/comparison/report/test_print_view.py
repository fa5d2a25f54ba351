"""The print as the report draws it: what is laid, where, and with how many points."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ccfem.comparison.report import print_view
from ccfem.comparison.report.packing import pack, unpack
from ccfem.comparison.report.print_view import KINDS, print_views
from ccfem.comparison.report.report_views import RunResults
from ccfem.comparison.runs import Run
from ccfem.machine import Machine
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.printing.moves import LAY, TRAVEL
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import PrintPlan
from ccfem.strategies import Zigzag


@pytest.fixture(scope="module")
def run():
    """Eight layers, each a circle of 20 mm radius in the middle of the bed."""
    turns = np.linspace(0.0, 2.0 * np.pi, 401)
    circle = 100.0 + 20.0 * np.column_stack([np.cos(turns), np.sin(turns)])
    top = 0.2 * np.arange(1, 9)
    points = np.concatenate([np.column_stack([circle, np.full(401, z)]) for z in top])
    paths = Toolpaths(
        points=points,
        normals=np.tile([0.0, 0.0, 1.0], (len(points), 1)),
        offsets=401 * np.arange(9),
        layer=np.arange(8),
        kind=np.full(8, MATRIX),
        closed=np.zeros(8, dtype=bool),
    )
    plan = PrintPlan(paths, top, np.full(8, 0.2))
    whole = Run("circles", Zigzag(), paths, None)
    return replace(whole, print_plan=plan, moves=part_moves(plan, Machine()))


def lengths(view, kind):
    """Length of the lines of a kind on each layer that is drawn, mm."""
    sums = []
    for layer in view["layers"]:
        lines = np.split(layer["points"].values, layer["offsets"][1:-1])
        of_kind = [line for line, of in zip(lines, layer["kind"], strict=True) if of == kind]
        steps = [np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in of_kind]
        sums.append(sum(steps))
    return np.array(sums)


def test_all_that_is_laid_and_travelled_is_drawn(run):
    view = print_views([run])["runs"][0]
    assert view["count"] == len(view["layers"]) == 8
    assert [layer["top"] for layer in view["layers"]] == pytest.approx(0.2 * np.arange(1, 9))
    laid = sum(lengths(view, k) for k in range(len(KINDS) - 1))
    moves = run.moves
    for event, drawn in ((LAY, laid), (TRAVEL, lengths(view, len(KINDS) - 1))):
        of_moves = np.bincount(moves.layer, np.where(moves.event == event, moves.length, 0.0))
        # The chord of an arc of 20 mm radius with 0.03 mm of sagitta is 0.05 % shorter.
        assert drawn == pytest.approx(of_moves, rel=1e-3)
    assert (lengths(view, KINDS.index("contour")) + lengths(view, KINDS.index("matrix"))).min() > (
        0.99 * 2.0 * np.pi * 20.0
    )
    assert sum(len(layer["points"].values) for layer in view["layers"]) < 0.4 * len(moves)


def test_the_same_lines_are_read_back_from_the_report(run):
    views = print_views([run])
    results = RunResults(Path(), {}, unpack(pack({"print": views})))
    layers = results.print_layers("circles")
    assert layers[7].said == "Layer 8 of 8, up to 1.6 mm"
    for kind in range(len(KINDS)):
        drawn = [
            np.linalg.norm(layer.ends[:, 1] - layer.ends[:, 0], axis=1)[layer.kind == kind].sum()
            for layer in layers
        ]
        assert drawn == pytest.approx(lengths(views["runs"][0], kind), rel=2e-3)  # of 0.01 mm
    assert results.print_layers("another") == []


def test_a_large_print_is_drawn_on_some_layers(run, monkeypatch):
    monkeypatch.setattr(print_view, "_POINTS", 200)
    view = print_views([run])["runs"][0]
    shown = [layer["index"] for layer in view["layers"]]
    assert view["count"] == 8
    assert 2 <= len(shown) < 8
    assert (shown[0], shown[-1]) == (0, 7)


def test_runs_without_a_print_have_no_view(run):
    assert print_views([replace(run, moves=None)])["runs"] == []
