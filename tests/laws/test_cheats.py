"""The law of the judge: paths that nobody can print do not win, and are named for what they are.

Each cheat takes the rings of `concentric`, or the lines of `zigzag`, and lays more of them than
fits, or where nothing holds them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import ccfem
from benchmarks.studies.cheats import TOP, sets
from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.cases.case import Case
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.geometry.polylines import lengths, sample_at
from ccfem.paths.planning import GivenPaths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import Layer
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create

HONEST = ("isocurve", "concentric", "zigzag")

Lines = list[np.ndarray]


def rings(layer, stress, machine, spacing=6.0) -> Lines:
    paths = create("concentric", {"spacing": spacing})(layer, stress, machine)
    return [layer.plane.project(path) for path in paths]


def along(line, arc):
    """Points of a line at arc lengths."""
    points, _ = sample_at(line, np.array([0, len(line)]), np.zeros(len(arc), dtype=int), arc)
    return points


def waves(line, height, period):
    length = lengths(line, np.array([0, len(line)]))[0]
    arc = np.linspace(0.0, length, int(12 * length / period))
    points = along(line, arc)
    tangent = np.gradient(points, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return points + height * np.sin(2.0 * np.pi * arc / period)[:, None] * normal


def back_and_forth(line):
    length = lengths(line, np.array([0, len(line)]))[0]
    steps = np.cumsum(np.tile([1.0, -0.6], int(length / 0.4)))
    return along(line, np.clip(np.append(0.0, steps), 0.0, length))


def pieces(line):
    length = lengths(line, np.array([0, len(line)]))[0]
    starts = np.arange(0.0, length - 1.0, 1.2)
    return [along(line, np.array([s, s + 0.5, s + 1.0])) for s in starts]


def copies(layer, stress, machine):
    return rings(layer, stress, machine) * 5


def bundles(layer, stress, machine):
    lines = rings(layer, stress, machine)
    return [line + 0.15 * k for line in lines for k in range(-3, 4)]


def short_pieces(layer, stress, machine):
    return [piece for line in rings(layer, stress, machine) for piece in pieces(line)]


def micro_waves(layer, stress, machine):
    return [waves(line, 0.4, 1.2) for line in rings(layer, stress, machine)]


def meanders(layer, stress, machine):
    return [waves(line, 1.2, 1.0) for line in rings(layer, stress, machine)]


def there_and_back(layer, stress, machine):
    return [back_and_forth(line) for line in rings(layer, stress, machine)]


def one_layer(layer, stress, machine):
    return rings(layer, stress, machine, 2.0) * 3 if layer.index == 1 else []


def winding(layer, stress, machine):
    """Each ring as one strand of five turns."""
    turns = [[line] + [line[1:]] * 4 for line in rings(layer, stress, machine)]
    return [np.concatenate(line) for line in turns]


def on_the_border(layer, stress, machine):
    """Strands of which half lies outside the part."""
    parts = [layer.plane.polygon] if layer.plane.polygon.geom_type == "Polygon" else []
    loops = [ring for part in parts for ring in (part.exterior, *part.interiors)]
    return [np.asarray(ring.coords) for ring in loops]


def fan(layer, stress, machine):
    """Two dense families of strands that cross at 31 degrees."""
    hatches = [{"angle": a, "turn": 0.0, "spacing": 2.0} for a in (15.5, -15.5)]
    paths = [create("zigzag", each)(layer, stress, machine) for each in hatches]
    return [layer.plane.project(path) for each in paths for path in each]


def outside(layer, stress, machine):
    """Rings in the part, and their ends drawn far beyond it."""
    far = layer.plane.points.max(axis=0) + 60.0
    return [np.concatenate([line[:-1], [far]]) for line in rings(layer, stress, machine)]


def as_links(layer, stress, machine):
    return rings(layer, stress, machine)


CHEATS: dict[str, tuple[Callable[..., Lines], str]] = {
    "copies": (copies, "lies on other fibre"),
    "bundles": (bundles, "lies on other fibre"),
    "short_pieces": (short_pieces, "too short for the cutter"),
    "micro_waves": (micro_waves, "turns tighter than"),
    "meanders": (meanders, "turns tighter than"),
    "there_and_back": (there_and_back, "lies on other fibre"),
    "one_layer": (one_layer, "lies on other fibre"),
    "winding": (winding, "lies on other fibre"),
    "on_the_border": (on_the_border, "lies outside the part"),
    "fan": (fan, "lies across other fibre"),
    "outside": (outside, "hangs free over"),
    "as_links": (as_links, "is marked as links"),
}


@dataclass(frozen=True)
class Cheat:
    """A strategy that lays what a function draws, and whose folds planning leaves as they are."""

    name: str

    folds: ClassVar[bool] = True

    def __call__(self, layer: Layer, stress, machine) -> Toolpaths:
        draw, _ = CHEATS[self.name]
        lines = [np.asarray(line, dtype=float) for line in draw(layer, stress, machine)]
        link = None
        if draw is as_links:
            link = [np.append(np.ones(len(line) - 1, dtype=bool), False) for line in lines]
        return Toolpaths.from_plane(lines, layer, link=link)


PARTS: dict[str, tuple[float, int, tuple[str, ...]]] = {
    "bar": (7.0, 2, tuple(CHEATS)),
    "loop": (14.0, 1, ("bundles", "micro_waves", "on_the_border", "fan", "outside")),
}
"""Parts, with element sizes and layers; on the round one those cheats that lie otherwise there."""

UNTESTED = {"bar": {"short_pieces", "meanders", "outside"}, "loop": {"bundles", "outside"}}
"""Cheats that leave the part, or of which nothing is left to print, so that none is tested."""


@pytest.fixture(scope="module", params=PARTS)
def judged(request):
    size, layers, cheats = PARTS[request.param]
    case = ccfem.read(request.param, element_size=size)
    strategies = {name: create(name, case.parameters.get(name, {})) for name in HONEST}
    strategies |= {name: Cheat(name) for name in cheats}
    return ccfem.compare(case, strategies, layers=layers, natural=True)


def test_no_cheat_ranks_above_an_honest_strategy(judged):
    order = [run.name for run in judged.ranking]
    assert set(order[: len(HONEST)]) == set(HONEST)
    assert set(order[len(HONEST) :]) == set(PARTS[judged.case.name][2])
    assert judged.ranking[0].printable
    assert not any(name in judged.verdict.split(" Not printable")[0] for name in CHEATS)
    table = judged.frame.set_index("strategy")
    assert table.loc[list(HONEST), "printable"].all()
    assert not table.loc[order[len(HONEST) :], "printable"].any()


def test_each_cheat_is_named_for_what_it_is(judged):
    cheats = judged.runs[len(HONEST) :]
    assert tuple(run.name for run in cheats) == PARTS[judged.case.name][2]
    for run in cheats:
        _, said = CHEATS[run.name]
        assert said in (run.why_not or run.failure), run.name
        assert any(run.name in line.split(":")[0] and said in line for line in judged.remarks)


@pytest.mark.parametrize("judged", ["bar"], indirect=True)
def test_piling_up_gains_nothing(judged):
    """Without the verdict too: copies and turns of a winding are worth the ring that they hide."""
    case, stress = judged.case, judged.stress
    plain = ccfem.plan(create("concentric", {"spacing": 6.0}), judged.layers, stress, case.machine)
    once = ccfem.virtual_test(plain, stress, machine=case.machine, span=()).ratio
    runs = {run.name: run for run in judged.runs}
    for name, rel in (("copies", 1e-3), ("winding", 0.01)):
        found = runs[name].tested.bracket.tension.ratio
        assert found == pytest.approx(once, rel=rel), name
    as_laid = ccfem.virtual_test(runs["copies"].toolpaths, stress, span=()).ratio
    assert as_laid - 1.0 > 3.0 * (once - 1.0)
    # Nothing that is piled up beats strands that fill the layer side by side.
    dense = ccfem.plan(create("concentric", {"spacing": 1.0}), judged.layers, stress, case.machine)
    full = ccfem.virtual_test(dense, stress, machine=case.machine, span=()).ratio
    piled = ("copies", "bundles", "winding", "one_layer", "there_and_back", "micro_waves")
    assert all(runs[name].tested.bracket.tension.ratio < full for name in piled)


def test_no_cheat_exceeds_the_bound(judged):
    """The bound has one strand a width in each layer; only strands that cross may have more."""
    ratios = {run.name: run.tested.bracket.tension.ratio for run in judged.runs if run.tested}
    name = judged.case.name
    assert ratios.keys() == {*HONEST, *PARTS[name][2]} - UNTESTED[name]
    del ratios["fan"]
    assert max(ratios.values()) <= judged.bound.ratio


def test_fibre_on_the_skin_is_not_printable():
    case = ccfem.read("bar", element_size=5.0)
    asked = {"natural": True, "strand": None}
    (on_skin,) = ccfem.compare(case, ["zigzag"], layers=[0.0, 2.5], **asked).runs
    assert "50% of the fibre stands out of the part's top or bottom" in on_skin.why_not
    # Strands are 0.1075 mm high, and 0.15 mm of matrix below them hold them (`Process.cover`): a
    # first layer is printable from 0.204 mm on.
    (thin,) = ccfem.compare(case, ["zigzag"], layers=[0.2, 2.5], **asked).runs
    assert thin.why_not.startswith("0.146 mm of matrix below the first fibre layer do not hold it")
    (inside,) = ccfem.compare(case, ["zigzag"], layers=[0.25, 2.5], **asked).runs
    assert inside.printable


@pytest.mark.parametrize(
    ("layers", "said"),
    [
        ([1.0, 1.0, 1.0], "each layer height must be given once"),
        ([1.0, 1.01, 1.02], "layers must lie at least 0.1075 mm apart"),
        (500, "layers must lie at least 0.1075 mm apart"),
    ],
)
def test_layers_on_each_other_are_refused(layers, said):
    with pytest.raises(InputError, match=said):
        ccfem.compare(ccfem.read("bar", element_size=5.0), ["zigzag"], layers=layers)


NAMED = {
    "rows_on_border": "lie outside the part by more than 5% of their width; the worst by 50%",
    "woven": "lies across other fibre",
    "hairpins": "have no 42 mm free of turns by more than 90 degrees within 4 mm",
    "rows_too_close": "lies on other fibre",
    "close_and_outside": "lie outside the part by more than 5% of their width; the worst by 40%",
    "out_and_back": "50% of the fibre lies on other fibre of its direction",
    "hairpins_on_border": "have no 42 mm free of turns",
    "woven_and_outside": "lie outside the part",
    "bulbs": "have no 42 mm free of turns",
    "short_pieces": "no strand is left to print",
    "bit_of_each": "lie outside the part",
    "outside_folded_woven": "lie outside the part by more than 5% of their width; the worst by 40%",
    "loops": "have no 42 mm free of turns",
    "rings_with_loops": "have no 42 mm free of turns",
    "link_on_border": "lie outside the part by more than 5% of their width; the worst by 50%",
}
"""What is said of the sets of `benchmarks.studies.cheats`, of 588 mm a layer."""


@pytest.fixture(scope="module")
def cantilever():
    """Root held, tip pulled down: a third as high as in the study, with two layers."""
    mesh = box_mesh((100.0, TOP, 2.0), (16, 4, 1))
    loads = {"down": (Force("x_max", (0.0, -20.0 / 3.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("x_min"),), loads)
    case = Case("cantilever", "Cantilever", problem, slicing=Planar(count=2))
    layers = case.slicing.cut(mesh)
    given = {
        name: GivenPaths(
            Toolpaths.concatenate(Toolpaths.from_plane(lines, layer) for layer in layers), ""
        )
        for name, lines in sets().items()
    }
    rows = given["rows_on_border"].toolpaths
    link = rows.points[:, 1] > TOP - 0.1
    link[rows.offsets[1:] - 1] = False
    given["link_on_border"] = GivenPaths(replace(rows, link=link))
    # A file that says that its turns are meant is believed: they carry nothing anyway.
    given["claimed"] = replace(given["hairpins"], pattern="zigzag")
    return {run.name: run for run in ccfem.compare(case, given, natural=True).runs}


def test_cheats_on_a_cantilever_are_named(cantilever):
    assert [name for name, run in cantilever.items() if run.printable] == [
        "honest_rows",
        "two_corners",
        "claimed",
    ]
    for name, said in NAMED.items():
        assert said in cantilever[name].why_not + cantilever[name].failure, name


def test_cheats_on_a_cantilever_gain_nothing(cantilever):
    ratio = {
        name: run.tested.bracket.tension.ratio for name, run in cantilever.items() if run.tested
    }
    honest = ratio.pop("honest_rows")
    assert ratio.keys() == (NAMED.keys() | {"two_corners", "claimed"}) - {"short_pieces"}
    # Half of the strand on the border counts: as much lies at the top of the honest rows.
    border = ("rows_on_border", "close_and_outside", "bit_of_each", "link_on_border")
    outside = {ratio.pop(name) for name in border}
    assert max(outside) < 1.02 * honest
    assert max(ratio.values()) < honest
    assert ratio["woven"] < 0.95 * honest
