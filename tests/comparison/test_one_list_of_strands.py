"""What is judged is what is printed: strands, cuts, time and mass of table, record and file agree.

The numbers of the file are read by the printer on paper of `benchmarks.print_checks`.
"""

import csv
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.job import own
from benchmarks.print_checks.printer import follow
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.engine import answer, compare
from ccfem.comparison.files import record, results_rows, write_table
from ccfem.comparison.headline import HEADLINE, cell_text
from ccfem.comparison.report.html_report import report_html
from ccfem.comparison.request import Request
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.strand_room import strand_parts
from ccfem.machine import Machine, machine_names, machine_table, updated
from ccfem.paths.planning import GivenPaths
from ccfem.paths.splitting.printed_strands import printed_strands
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.gcode import gcode_of_moves
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create

SIZE = (130.0, 60.0, 1.4)
HEIGHTS = (0.7, 1.05)


def case_on(name):
    """A plate, pulled along x on one half of its end."""
    mesh = box_mesh(SIZE, (13, 6, 1))
    supports = (Support("x_min"),)
    loads = {"pull": (Force("x_max", (300.0, 100.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), supports, loads)
    machine = updated(Machine(), machine_table(name))
    return Case("plate", "Plate", problem, slicing=Planar(heights=HEIGHTS), machine=machine)


def woven(case):
    """Two bundles across each other, one of which leaves the part, and a short strand."""
    width = case.machine.fibre_width
    offset = width * (np.arange(20) - 9.5)
    along = [np.array([[5.0, 30.0 + y], [125.0, 30.0 + y]]) for y in offset]
    across = [np.array([[65.0 + x, -8.0], [65.0 + x, 55.0]]) for x in offset]
    short = [np.array([[4.0, 4.0], [24.0, 4.0]])]
    layers = case.slicing.cut(case.problem.mesh)
    paths = (Toolpaths.from_plane(along + across + short, layer) for layer in layers)
    return GivenPaths(Toolpaths.concatenate(paths), "woven.csv")


@pytest.fixture(scope="module", params=machine_names())
def printed(request):
    """Runs that are printed, and their files as a printer on paper read them, by name."""
    case = case_on(request.param)
    strategies = {"woven": woven(case), "concentric": create("concentric", {"spacing": 3.0})}
    strategies["isocurve"] = create("isocurve")
    done = compare(case, strategies, natural=True, strand=None, print_plans=True)
    texts = {run.name: gcode_of_moves(run.moves, run.print_plan, case.machine) for run in done.runs}
    return done, {name: follow(text, request.param) for name, text in texts.items()}


def on_the_bed(run, case):
    """Strands that were judged, moved onto the bed, without their height."""
    shift = 0.5 * (np.array(case.machine.gcode.bed[:2]) - np.array(SIZE[:2]))
    return [line[:, :2] + shift for line in run.toolpaths]


def length(line):
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def test_strands_are_the_same_in_count_ends_and_length(printed):
    done, files = printed
    for run in done.runs:
        strands = list(own(files[run.name]).values())
        judged = on_the_bed(run, done.case)
        assert len(strands) == len(judged) == run.evaluation.total["cuts"]
        ends = np.array([[steps[0].start[:2], steps[-1].end[:2]] for steps in strands])
        sizes = np.array([sum(step.length for step in steps) for steps in strands])
        left = np.ones(len(strands), dtype=bool)
        for line in judged:
            either = np.minimum(
                np.abs(ends - line[[0, -1]]).max(axis=(1, 2)),
                np.abs(ends - line[[-1, 0]]).max(axis=(1, 2)),
            )
            k = int(np.where(left, either, np.inf).argmin())
            assert either[k] < 2e-3  # coordinates of files have three decimals
            assert sizes[k] == pytest.approx(length(line), rel=1e-3)
            left[k] = False


def test_strands_time_and_mass_are_those_of_the_file(printed, tmp_path):
    done, files = printed
    write_table(results_rows(done), tmp_path / "results.csv")
    with (tmp_path / "results.csv").open() as file:
        totals = {row["strategy"]: row for row in csv.DictReader(file) if row["layer"] == "total"}
    first = [head.title for head in done.table.first.heads]
    assert len(first) <= 6
    assert [title for title in first if title.endswith("min")] == ["whole print, min"]
    known = {run["name"]: run["total"] for run in record(done, "", {})["strategies"]}
    table = done.frame.set_index("strategy")
    for run in done.runs:
        head = files[run.name].head
        matrix, fibre = (float(mass) for mass in head["filament used [g]"].split(","))
        for values in (totals[run.name], known[run.name], table.loc[run.name]):
            assert float(values["whole_print_time"]) == pytest.approx(float(head["TIME"]), rel=0.02)
            assert float(values["fibre_mass"]) == pytest.approx(fibre, rel=0.01)
            assert float(values["matrix_mass"]) == pytest.approx(matrix, rel=0.01)
            assert float(values["cuts"]) == len(run.toolpaths)
            total = run.toolpaths.lengths.sum()
            assert float(values["fibre_length"]) == pytest.approx(total, rel=1e-6)
        minutes = next(head for head in HEADLINE if head.column == "whole_print_time")
        assert float(cell_text(run, minutes)[0]) == pytest.approx(float(head["TIME"]) / 60, abs=1.0)


def test_what_is_too_short_or_stacked_is_judged_as_it_is_printed(printed):
    """The woven strands of `woven`: 40 long ones, and on each layer 20 mm that no cutter allows."""
    done, _ = printed
    run, machine = done.runs[0], done.case.machine
    planned = 2 * (20 * 120.0 + 20 * 63.0)
    laid = float(run.toolpaths.lengths.sum())
    # Bundles a width apart that cross stand two strands high, twice what fits in one layer.
    if machine.process.stacks == "end":
        assert laid < planned - 100.0
        assert laid + run.strands.ended + run.strands.short.lengths.sum() + run.strands.dropped == (
            pytest.approx(planned + 40.0, abs=0.01)
        )
    else:
        assert laid == pytest.approx(planned)
    assert run.toolpaths.lengths.min() >= machine.minimum_length * (1.0 - 1e-6)


def test_strands_are_split_once(printed):
    done, _ = printed
    for run in done.runs:
        layers, mesh = done.layers, done.case.problem.mesh
        again = printed_strands(run.toolpaths, layers, mesh, done.case.machine)
        np.testing.assert_array_equal(again.fibre.points, run.toolpaths.points)
        assert again.warnings == ()


def test_a_border_cuts_a_strand_also_where_it_crosses_itself():
    """A loop that leaves a square by its right side and crosses itself inside it."""
    case = case_on("chen2021")
    (layer, _) = case.slicing.cut(case.problem.mesh)
    turn = np.linspace(0.0, 2.0 * np.pi, 400)
    loop = np.stack([110.0 + 40.0 * np.sin(turn), 30.0 + 15.0 * np.sin(2.0 * turn)], axis=1)
    loop[-1] = loop[0]  # a figure of eight: 70 to 150 along x, the part ends at 130
    machine = replace(case.machine, process=replace(case.machine.process, turns="cut"))
    paths = Toolpaths.from_plane([loop], layer)
    (line,) = printed_strands(paths, [layer], case.problem.mesh, machine).fibre
    assert line[:, 0].max() == pytest.approx(130.0)
    inner = shapely.intersection(shapely.LineString(loop), shapely.box(0.0, 0.0, 130.0, 60.0))
    assert length(line) == pytest.approx(inner.length, abs=1e-6)


class Rows(HTMLParser):
    """Rows of all tables of a page, as lists of the texts of their cells."""

    def __init__(self, page):
        super().__init__()
        self.rows, self.cell = [], None
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th") and self.rows:
            self.cell = ""

    def handle_endtag(self, tag):
        if tag in ("td", "th") and self.cell is not None:
            self.rows[-1].append(self.cell.strip())
            self.cell = None

    def handle_data(self, data):
        if self.cell is not None:
            self.cell += data


def test_the_page_says_what_is_in_the_file(printed):
    """The page is read as a browser reads it, the file as a printer does."""
    done, files = printed
    page = report_html(done, {**record(done, "", {}), "left_out": []})
    tables = {row[0]: row[1:] for row in Rows(page).rows if row}
    names = [run.name for run in done.ranking if run.evaluation is not None]

    def said(index):
        (texts,) = (cells for name, cells in tables.items() if name.partition(" ")[0] == index)
        return [float(text.replace(",", "")) for text in texts]

    for k, name in enumerate(names):
        run, head = files[name], files[name].head
        matrix, fibre = (float(mass) for mass in head["filament used [g]"].split(","))
        assert said("paths")[k] == said("cuts")[k] == len(own(run))
        assert said("whole_print_time")[k] == pytest.approx(float(head["TIME"]), rel=0.02)
        assert said("matrix_mass")[k] == pytest.approx(matrix, rel=0.01)
        assert said("fibre_mass")[k] == pytest.approx(fibre, rel=0.01)


def test_parts_of_strands_are_found_once_a_run(monkeypatch):
    """By the rules for strands; the virtual test takes them from there."""
    counted = []

    def parts(toolpaths, *about, **how):
        counted.append(len(toolpaths))
        return strand_parts(toolpaths, *about, **how)

    monkeypatch.setattr("ccfem.judging.evaluation.strand_rules.strand_parts", parts)
    monkeypatch.setattr("ccfem.judging.virtual_testing.strands.strand_parts", None)
    done = answer(Request.of(case_on("chen2021"), ["concentric"], natural=True, bound=False))
    assert sum(counted) == len(done.runs[0].toolpaths)
    assert done.runs[0].tested.bracket.tension.ratio > 1.0


def test_plans_of_much_fibre_are_tested_on_demand():
    asked = Request.of(case_on("chen2021"), ["concentric"], natural=True, longest_test=1e3)
    done = answer(asked)
    (run,) = done.runs
    assert run.evaluation is not None
    assert run.tested is None
    assert run.untested.endswith("m of fibre, above 1 m only by --virtual-test")
    assert not done.bounds
    assert run.strand_verdict.parts is None
