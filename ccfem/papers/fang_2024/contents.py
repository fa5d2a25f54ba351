"""What of Fang et al. 2024 can be made again."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, silent
from ccfem.cases.shipped import t_bracket
from ccfem.comparison.files import write_results
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.stack_page import space_picture, turning_page
from ccfem.comparison.result import Comparison
from ccfem.fem.elasticity import PartStress, StressField, solve
from ccfem.fem.elasticity.zone import ZONE, distance_from_patches
from ccfem.geometry.locate import locate
from ccfem.judging.virtual_testing.failure_laws.interlayer import layer_traction
from ccfem.machine import Machine
from ccfem.papers.contents import Contents, table, write_claims
from ccfem.papers.fang_2024.authors import authors_mesh, authors_stress, finer_mesh
from ccfem.papers.fang_2024.planar_against_curved import ROWS, against, failure_loads
from ccfem.papers.fang_2024.t_bracket import PAPER_SECONDS, study, timed_chain
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import MATRIX
from ccfem.printing.export.robot_waypoints import write_robot_waypoints
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.spatial import Spatial, SpatialSlicing
from ccfem.strategies import create
from ccfem.strategies.winding_curves.piece import pieces_with_joints

EXPECTED = Path(__file__).with_name("expected.toml")
"""Claims of the paper, with the ranges that count as reproduced."""

# The whole of the paper: its study, figures, tables and claims beside ours.


def write_all(
    folder: Path, progress: Progress = silent, loads: Sequence[str] = ("pull", "side")
) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    progress("solving the authors' part", 0.0)
    stress = authors_stress(authors_mesh())
    chain = timed_chain(stress)
    sliced, paths = chain.sliced, chain.strands
    finer = timed_chain(authors_stress(finer_mesh(), order=1)).seconds
    strands = study(stress, sliced)
    with_fibre = set(paths.layer.tolist())
    reached = field_figures(sliced, stress, with_fibre)
    targets = targets_table(reached, strands, chain.seconds, finer)
    (folder / "targets.md").write_text(targets, encoding="utf-8")
    print(f"\n{targets}", flush=True)
    title, build = "T-bracket, spatial layers, winding strands", (0.0, 1.0, 0.0)
    picture = png(space_picture(sliced.layers, paths, title, build))
    (folder / "t_bracket.png").write_bytes(picture)
    page = turning_page(sliced.layers, paths, title, build)
    (folder / "t_bracket.html").write_text(page, encoding="utf-8")
    machine = Machine()
    write_robot_waypoints(folder / "waypoints.csv", paths, sliced.layers, machine)
    matrix = folder / "matrix_waypoints.csv"
    write_robot_waypoints(matrix, chain.matrix, sliced.layers, machine, MATRIX)
    field = field_study(sliced)
    print(f"\n{field_table(field)}", flush=True)
    tests: dict[str, Comparison] = {}
    for load in loads:
        progress(f"comparing slicings under load {load}", 0.3 + 0.3 * len(tests))
        tests[load] = against(load)
        (folder / load).mkdir(exist_ok=True)
        write_results(tests[load], folder / load)
    values = quantities(field, strands, chain.seconds, tests)
    values["170 k cells: seconds"] = finer["all, clock"]
    if "pull" in tests:
        values |= _failures_explained(tests["pull"], folder)
    print(f"\n{write_claims(folder, values, EXPECTED)}")


def _failures_explained(pulled: Comparison, folder: Path) -> dict[str, float]:
    """Print and draw where layers open under the pull; what bond the paper's loads would need."""
    where = {"walls fixed": openings(pulled), "bolts press": openings(pulled, pressing=True)}
    tensile = pulled.case.problem.material.interlayer_tensile
    assert tensile is not None
    text = openings_table(where, tensile)
    (folder / "where_layers_open.md").write_text(text, encoding="utf-8")
    title = f"Pull on the head: load that opens the layers, bond of {tensile:g} MPa"
    openings_picture(where, title, folder / "where_layers_open.png")
    print(f"\n{text}", flush=True)
    return bonds_needed(where, tensile)


# The claims of the paper beside ours: every quantity is computed from a run.


def quantities(
    field: Mapping[str, float],
    strands: Mapping[str, Mapping[str, float]],
    seconds: Mapping[str, float],
    tests: Mapping[str, Comparison],
) -> dict[str, float]:
    """Every quantity that `expected.toml` may name; orders that hold are 1, others 0."""
    values = {**field, **{f"seconds, {name}": value for name, value in seconds.items()}}
    for name, figures in strands.items():
        values |= {f"{name}: {key}": value for key, value in figures.items()}
    for figure, name in (("thickness ratio", "thickness ratio"), ("pieces a layer", "pieces")):
        ratio = values[f"all lines {figure}"] / values[f"default {figure}"]
        values[f"all lines {name} over default"] = ratio
    values["time over the paper's"] = seconds["all, clock"] / PAPER_SECONDS["all"]
    for load, compared in tests.items():
        values |= _loads(load, compared)
    return values


def _loads(load: str, compared: Comparison) -> dict[str, float]:
    """Orders of slicings under one load, with fixed and with pressing supports."""
    values: dict[str, float] = {}
    for held, end in (("fixed", ""), ("pressing", "_alternative")):
        about = f"{load}, {held}"
        fails = failure_loads(compared, f"first_failure_load{end}")
        stiff = failure_loads(compared, f"stiffness_ratio_tension{end}")
        z, x, y = (fails[f"planar {axis}"] for axis in "zxy")
        curved = fails["spatial"]
        values[f"{about}: z below x"] = float(z < x)
        values[f"{about}: x below spatial"] = float(x < curved)
        values[f"{about}: spatial above all flat"] = float(curved > max(x, y, z))
        values[f"{about}: z over x"] = z / x
        values[f"{about}: y over x"] = y / x
        values[f"{about}: spatial over the weakest"] = curved / min(x, y, z)
        values[f"{about}: spatial stiffest"] = float(stiff["spatial"] >= max(stiff.values()))
    for name in ("planar z", "planar x", "planar y", "spatial"):
        values[f"{load}, {name}: angle to stress"] = failure_loads(compared, "space_angle_stress")[
            name
        ]
        values[f"{load}, {name}: joints linked"] = failure_loads(compared, "joints_linked")[name]
    return values


# The field and its layers under other weights, thicknesses, terms of the joints, and meshes.


BUILD = (0.0, 1.0, 0.0)

VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "smoothness 0.001": {"smoothness": 0.001},
    "smoothness 0.1": {"smoothness": 0.1},
    "smoothness 1": {"smoothness": 1.0},
    "joints 0.1": {"joint_weight": 0.1},
    "joints 10": {"joint_weight": 10.0},
    "ring": {"form": "ring"},
    "literal": {"form": "literal"},
    "all lines": {"lines": "all"},
    "thickness 0.3": {"thickness": 0.3},
    "thickness 0.8": {"thickness": 0.8},
}
"""Parameters of `Spatial`: weights of the paper's figure 7, the joints' term, its line filter."""

COLUMNS = ("angle_mean", "within_10", "thickness_5", "thickness_50", "thickness_95", "folded")


def field_study(fine: SpatialSlicing) -> dict[str, float]:
    """Figures by "VARIANT quantity" on the mesh of the case, and "84 k cells" on the authors' part.

    Parameters
    ----------
    fine : SpatialSlicing
        Of the authors' part, with the default parameters.
    """
    stress = solve(t_bracket(order=1).problem)["pull"]
    values: dict[str, float] = {}
    slicings: dict[str, SpatialSlicing] = {}
    for name, given in VARIANTS.items():
        try:
            slicings[name] = Spatial(**given).slice(stress, BUILD)
        except InputError as error:
            print(f"{name}: {error}")
            continue
        values |= _figures(name, slicings[name])
    values |= _figures("84 k cells", fine)
    values["degrees between normals on 30 k and 84 k cells"] = _between(slicings["default"], fine)
    for name, cut in (("cut", True), ("no cut", False)):
        layers = slicings["default"].layers
        paths = plan(create("winding", {"cut": cut}), layers, stress, Machine())
        values[f"{name} strands a layer"] = len(paths) / len(np.unique(paths.layer))
    return values


def _figures(name: str, slicing: SpatialSlicing) -> dict[str, float]:
    quality = vars(slicing.quality)
    pieces = [int(layer.component.max()) + 1 for layer in slicing.layers]
    values = {f"{name} {column}": float(quality[column]) for column in COLUMNS}
    ratio = quality["thickness_95"] / quality["thickness_5"]
    return {
        **values,
        f"{name} thickness ratio": float(ratio),
        f"{name} pieces a layer": float(np.mean(pieces)),
        f"{name} layers": float(len(slicing.layers)),
    }


def _between(coarse: SpatialSlicing, fine: SpatialSlicing) -> float:
    """Mean angle, degrees, by volume, between the normals of two fields on meshes of one part.

    The part is its own mirror image in z, and so are fields of other signs of as low an energy:
    the nearer of the two counts.
    """
    mesh, coarse_mesh = fine.field.mesh, coarse.field.mesh
    centre = coarse_mesh.centres
    angles = []
    for mirror in ([1.0, 1.0, 1.0], [1.0, 1.0, -1.0]):
        holder, _ = locate(mesh.points, mesh.corners, centre * mirror, 2.0)
        inside = holder >= 0
        a, b = coarse.field.gradient[inside], fine.field.gradient[holder[inside]] * mirror
        size = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        cosine = np.abs(np.einsum("ed,ed->e", a, b)) / np.maximum(size, 1e-300)
        angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
        angles.append(float(np.average(angle, weights=coarse_mesh.volumes[inside])))
    return min(angles)


def field_table(figures: Mapping[str, float]) -> str:
    """Markdown table of the variants."""
    heads = (*COLUMNS, "thickness ratio", "pieces a layer", "layers")
    rows = [
        (name, *(f"{figures.get(f'{name} {head}', np.nan):.3g}" for head in heads))
        for name in (*VARIANTS, "84 k cells")
    ]
    return table(("field", *heads), rows)


# What layers and strands on the T-bracket have to reach, in one table beside the authors' own.


class _Target(NamedTuple):
    """A figure, the range that it has to lie in, and a better one to aim at."""

    figure: str
    low: float
    high: float
    aim: float | None = None


_INF = float("inf")
_FIELD = (
    _Target("stress to layer, degrees, by volume", 0.0, 9.0),
    _Target("thickness, 5 %, mm", 0.42, _INF),
    _Target("thickness, 50 %, mm", 0.42, 0.62),
    _Target("thickness, 95 %, mm", 0.0, 0.62),
    _Target("layers with all joints in one piece that carry no fibre", 0.0, 0.0),
)
_STRANDS = (
    _Target("per_layer", 3.5, 5.0),
    _Target("closed", 0.97, 1.0),
    _Target("round_all", 1.0, 1.0),
    _Target("angle", 0.0, 17.0, 15.0),
    _Target("angle_weighted", 0.0, 13.5, 12.0),
    _Target("spacing_10", 1.4, _INF, 1.6),
    _Target("spacing_50", 0.0, 2.4, 2.3),
    _Target("spacing_90", 0.0, 3.4, 3.0),
    _Target("curvature_95", 0.0, 0.14),
)
_SECONDS = (_Target("all, clock", 0.0, 15.0), _Target("slowest layer, processors", 0.0, 0.4))
_FINER = _Target("all, clock", 0.0, 40.0)


def field_figures(
    sliced: SpatialSlicing, stress: PartStress, with_fibre: set[int]
) -> dict[str, float]:
    """Figures of the layers by the names of their targets.

    Parameters
    ----------
    with_fibre : set of int
        Numbers of layers.
    """
    names, quality = stress.held_or_loaded, sliced.quality
    whole = {
        layer.index
        for layer in sliced.layers
        if max((len(piece.loops) for piece in pieces_with_joints(layer, names)), default=0) == 3
    }
    figures = (
        quality.angle_mean,
        quality.thickness_5,
        quality.thickness_50,
        quality.thickness_95,
        float(len(whole - with_fibre)),
    )
    return {target.figure: value for target, value in zip(_FIELD, figures, strict=True)}


def targets_table(
    field: Mapping[str, float],
    strands: Mapping[str, Mapping[str, float]],
    seconds: Mapping[str, float],
    finer: Mapping[str, float],
) -> str:
    """Markdown table: figure, ours, ours with ``even``, the authors', what is wanted, verdict."""
    ours, even, theirs = (strands[name] for name in ("winding", "winding, even", "authors"))
    rows = [_target_row(target, field[target.figure]) for target in _FIELD]
    for target in _STRANDS:
        name = target.figure
        rows.append(_target_row(target, ours[name], f"{even[name]:.3g}", f"{theirs[name]:.3g}"))
    rows += [
        _target_row(target, seconds[target.figure], name=f"seconds: {target.figure}")
        for target in _SECONDS
    ]
    rows.append(
        _target_row(_FINER, finer[_FINER.figure], name="seconds, 170 thousand cells: all, clock")
    )
    head = (
        "figure",
        "winding",
        "winding, even",
        "authors, same stress",
        "wanted",
        "aim",
        "verdict",
    )
    return table(head, rows)


def _target_row(
    target: _Target, ours: float, even: str = "", theirs: str = "", name: str = ""
) -> tuple[str, ...]:
    met = target.low <= ours <= target.high
    if target.high == _INF:
        wanted = f"at least {target.low:g}"
    elif target.low in (0.0, target.high):
        wanted = f"at most {target.high:g}" if target.low != target.high else f"{target.high:g}"
    else:
        wanted = f"{target.low:g} to {target.high:g}"
    verdict, aim = "met" if met else "not met", ""
    if target.aim is not None:
        aim = f"{target.aim:g}"
        reached = ours >= target.aim if target.high == _INF else ours <= target.aim
        verdict += ", aim reached" if reached else ", aim missed"
    return name or target.figure, f"{ours:.4g}", even, theirs, wanted, aim, verdict


# Why the paper's order of failure loads comes out or not: the load that opens layers, by place.
#
# Flat z layers of the paper came apart in the head at 0.87 kN, flat x layers at a lower corner of
# the base at 3.16 kN. Here: the load at which the bond fails in head, leg and base of each slicing,
# with its fibre, and the strength of the bond with which the head would come apart at 0.87 kN.


PLACES = {"base": (-np.inf, 20.0), "leg": (20.0, 35.0), "head": (35.0, np.inf)}
"""Parts of the T-bracket by height along y, mm."""
PAPER_LOADS = {"planar z": ("head", 0.87), "planar y": ("head", 0.87), "planar x": ("base", 3.16)}
"""Where the paper's flat prints came apart, and at what load, kN; its z may be our y."""


class Opening(NamedTuple):
    """Load, kN, at which the bond fails in each judged cell of one slicing."""

    middle: FloatArray  # (m, 3), mm
    load: FloatArray  # (m,): infinite where nothing opens or slides

    def at(self, place: str) -> float:
        """Load that opens a place first, kN."""
        low, high = PLACES[place]
        height = self.middle[:, 1]
        return float(self.load[(height > low) & (height <= high)].min())


def openings(compared: Comparison, pressing: bool = False) -> dict[str, Opening]:
    """Find the loads for the paper's slicings with its strategies on them.

    Parameters
    ----------
    compared : Comparison
        With virtual tests.
    pressing : bool
        Under bolts that only press, not fixed walls.
    """
    result = {}
    for slicing, strategy in ROWS.items():
        sliced = compared.slicings[slicing]
        tested = next(run.tested for run in sliced.runs if run.name == strategy)
        tested = tested.alternative if pressing and tested is not None else tested
        if tested is not None:
            test = tested.bracket.tension
            result[slicing] = _opening(test.solution, sliced.layers, test.force)
    return result


def _opening(stress: StressField, layers: tuple[Layer, ...], force: float) -> Opening:
    """Load of each cell outside the zones of loads and supports, as `interlayer` judges it."""
    mesh, material = stress.mesh, stress.problem.material
    middle = mesh.centres
    judged = np.flatnonzero(distance_from_patches(stress.problem, stress.case, middle, ZONE) > ZONE)
    opening, sliding, _ = layer_traction(stress, layers, judged)
    tensile = material.interlayer_tensile
    assert tensile is not None
    shear = tensile if material.interlayer_shear is None else material.interlayer_shear
    index = np.hypot(np.maximum(opening, 0.0) / tensile, sliding / shear)
    return Opening(middle[judged], 1e-3 * force / np.maximum(index, 1e-9))


def openings_table(by_supports: dict[str, dict[str, Opening]], tensile: float) -> str:
    """Markdown table over supports and slicings.

    Parameters
    ----------
    by_supports : dict of supports to dict of slicing to Opening
    tensile : float, MPa
        Strength of the bond that the loads are for; that of shear goes with it.
    """
    rows = []
    for supports, slicings in by_supports.items():
        for slicing, opening in slicings.items():
            loads = [f"{opening.at(place):.2f}" for place in PLACES]
            published, bond = "", ""
            if slicing in PAPER_LOADS:
                place, load = PAPER_LOADS[slicing]
                published, bond = f"{place} {load}", f"{_bond(slicing, opening, tensile):.1f}"
            rows.append((supports, slicing, *loads, published, bond))
    heads = [f"{place} opens at, kN" for place in PLACES]
    return table(("supports", "slicing", *heads, "paper", "bond that explains it, MPa"), rows)


def bonds_needed(by_supports: dict[str, dict[str, Opening]], tensile: float) -> dict[str, float]:
    """Strength of the bond, MPa, at which the paper's loads come out where it saw the failure."""
    return {
        f"{supports}, {slicing}: bond that explains the paper": _bond(slicing, opening, tensile)
        for supports, slicings in by_supports.items()
        for slicing, opening in slicings.items()
        if slicing in PAPER_LOADS
    }


def _bond(slicing: str, opening: Opening, tensile: float) -> float:
    place, load = PAPER_LOADS[slicing]
    return tensile * load / opening.at(place)


def openings_picture(by_supports: dict[str, dict[str, Opening]], title: str, file: Path) -> None:
    """Draw, seen along z, the least load that opens layers along each line of sight."""
    from matplotlib.colors import LogNorm

    from ccfem.comparison.plot.canvas import canvas

    columns = max(len(slicings) for slicings in by_supports.values())
    figure = canvas(4.0 * columns, 2.6 * len(by_supports) + 0.4, layout="constrained")
    grid = figure.subplots(len(by_supports), columns, squeeze=False)
    shades = None
    for row, (supports, slicings) in zip(grid, by_supports.items(), strict=True):
        for axes, (slicing, opening) in zip(row, slicings.items(), strict=True):
            order = np.argsort(-opening.load, kind="stable")
            x, y, _ = opening.middle[order].T
            load = opening.load[order]
            shades = axes.scatter(x, y, c=load, s=6, cmap="viridis_r", norm=LogNorm(1.0, 50.0))
            axes.plot(x[-1], y[-1], "rx", ms=11, mew=2.5)
            heading = f"{slicing}, {supports}: opens at {load[-1]:.2f} kN"
            if slicing in PAPER_LOADS:
                place, published = PAPER_LOADS[slicing]
                heading += f"\npaper: {place} at {published} kN, here {opening.at(place):.2f}"
            axes.set_title(heading, fontsize=9)
            axes.set_aspect("equal")
            axes.set_axis_off()
    if shades is not None:
        figure.colorbar(shades, ax=grid, shrink=0.7, label="load that opens the layers, kN")
    figure.suptitle(title)
    figure.savefig(file, dpi=110)


CONTENTS = Contents(
    title="Fang et al. 2024, curved layers and winding strands",
    seconds=1800.0,
    whole=write_all,
    needs="CCFEM_FANG2024",
)
