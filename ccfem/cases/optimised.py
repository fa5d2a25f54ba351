"""Topology optimisation of a case: the remaining part, as a case of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, in_brief
from ccfem.base.checks import check_known, check_number
from ccfem.base.errors import InputError
from ccfem.base.parallel import one_blas_thread
from ccfem.base.progress import Progress, silent
from ccfem.cases.case import Case
from ccfem.cases.designed import LAMINATE
from ccfem.fem.elasticity.load_kinds import patches_in_use
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.materials import plane_stress
from ccfem.fem.topopt import Design, Simp, Somp, as_problem
from ccfem.fem.topopt.flat_part import (
    FlatPart,
    flat_part,
    plane_stiffness,
    sheet_outline,
    sheet_part,
    sheet_problem,
)

# Places that an optimisation leaves full or empty: round and square areas, and boxes.


Place = Sequence[float]
"""3 numbers: x, y and radius of a disc; 4: corners of a rectangle; 6: corners of a box; mm."""


def check_places(what: str, places: Sequence[Place]) -> None:
    """Refuse places that are none."""
    for place in places:
        count = len(place)
        low, high = np.array(place[: count // 2]), np.array(place[-(count // 2) :])
        right = place[2] > 0.0 if count == 3 else count in (4, 6) and bool((low < high).all())
        if not right or not np.isfinite(place).all():
            raise InputError(
                f"a {what} place is X,Y,RADIUS, or the corners X,Y,X,Y of a rectangle or "
                f"X,Y,Z,X,Y,Z of a box, the lower one first, mm; got {list(place)}: give one of "
                "these three"
            )


def _corners(place: Place) -> tuple[Place, Place]:
    """Lower and upper corner of a rectangle or a box."""
    half = len(place) // 2
    return place[:half], place[half:]


def area_of(places: Sequence[Place]) -> Any:
    """Area of places seen from above: a shapely geometry, mm."""
    areas = []
    for place in places:
        if len(place) == 3:
            areas.append(shapely.Point(place[:2]).buffer(place[2], quad_segs=32))
        else:
            low, high = _corners(place)
            areas.append(shapely.box(*low[:2], *high[:2]))
    return shapely.union_all(areas) if areas else shapely.Polygon()


def cells_in(places: Sequence[Place], centres: FloatArray) -> BoolArray:
    """Which of some centres (m, 3), mm, lie in one of the places: an (m,) mask."""
    inside = np.zeros(len(centres), dtype=bool)
    for place in places:
        if len(place) == 3:
            inside |= np.linalg.norm(centres[:, :2] - np.array(place[:2]), axis=1) <= place[2]
        else:
            low, high = _corners(place)
            near = centres[:, : len(low)]
            inside |= ((near >= np.array(low)) & (near <= np.array(high))).all(axis=1)
    return inside


_CELLS = 4000.0
"""Number of squares of the element size into which a sheet is divided."""
_RIM = 2.0
"""Width of the solid rim beside a patch, in element sizes."""
_REACH = 2.0
"""Radius of the filter, in element sizes."""
_AS_WANTED = 0.1
"""Share by which the part may miss the volume fraction before there is a remark."""


@dataclass(frozen=True)
class Optimised:
    """A part that an optimisation found.

    Attributes
    ----------
    case : Case
        The remaining part, held, loaded and printed like the whole one.
    design : Design
        Densities, and the compliance of every iteration.
    element_size : float, mm
        Of the cells of the design.
    planform : shapely Polygon, mm, or None
        Outline of the part, if it was optimised as a sheet.
    remarks : tuple of str
        Remarks on the result, one line each.
    """

    case: Case
    design: Design
    element_size: float
    planform: Any
    remarks: tuple[str, ...]

    __repr__ = in_brief


Method = Literal["simp", "somp"]


@dataclass(frozen=True, kw_only=True)
class Optimisation:
    """What is asked of an optimisation: the parameters of `optimise` after the case.

    Attributes
    ----------
    volume_fraction : float in (0, 1)
    method : str
        "somp": densities and the axis of a laminate, for a sheet. "simp": densities only.
    element_size : float, mm, optional
        Edge length of the cells of a sheet; by default such that about 4000 squares fill it.
    radius : float, mm, optional
        Radius of the filter; default two element sizes.
    filter, max_iterations
        As in `Simp`.
    orientation : str, default "gradient"
        As in `Somp`; stiffer than the default there on nearly all plates, and slower.
    laminate : 4 floats, optional
        Modulus along the axis, modulus across, MPa, Poisson's ratio and shear modulus, MPa, for
        "somp"; default the part's own material if it has an axis, else that of Wang et al. 2021.
    weights : mapping of load case name to float, optional
        Weights of the compliances in the sum; default 1 each.
    keep : sequence of str, optional
        Patches beside which a rim of two element sizes stays solid; default those that are loaded,
        and curved ones that hold the part.
    solid, void : sequences of places
        Places that stay full, and empty: (x, y, radius), or the corners of a rectangle or box, mm.
    in_space : bool
        Do not take a flat part for a sheet.
    """

    volume_fraction: float
    method: Method = "somp"
    element_size: float | None = None
    radius: float | None = None
    filter: Literal["sensitivity", "density"] = "sensitivity"
    orientation: Literal["principal", "gradient", "fixed"] = "gradient"
    laminate: Sequence[float] | None = None
    weights: Mapping[str, float] | None = None
    keep: Sequence[str] | None = None
    solid: Sequence[Place] = ()
    void: Sequence[Place] = ()
    max_iterations: int = 200
    in_space: bool = False

    def __post_init__(self) -> None:
        check_number("volume fraction", self.volume_fraction, above=0.0, below=1.0)
        check_known("method", self.method, get_args(Method))
        check_places("solid", self.solid)
        check_places("void", self.void)


@one_blas_thread
def optimise(
    case: Case,
    volume_fraction: float,
    method: Method = "somp",
    *,
    progress: Progress = silent,
    **options: Any,
) -> Optimised:
    """Find the stiffest part with a share of the volume of a case.

    A prism along z whose loads lie in its plane is optimised as a sheet in plane stress, with one
    layer of cells of its own, and the outline of the design is extruded again. Other parts are
    optimised in space, on their own cells. Combinations of load cases do not count here.

    Parameters
    ----------
    case : Case
        The initial part: its whole volume may be used.
    volume_fraction, method
        As in `Optimisation`.
    progress : callable, optional
    **options
        The other attributes of `Optimisation`, as ``element_size=1.5``.

    Raises
    ------
    InputError
        For a case that cannot be optimised this way; when the design falls apart.
    SolveError
        When a solve misses its tolerance.
    """
    asked = Optimisation(volume_fraction=volume_fraction, method=method, **options)
    return find_design(case, asked, progress)


def find_design(case: Case, asked: Optimisation, progress: Progress = silent) -> Optimised:
    """Carry out an optimisation: `optimise` with what is asked of it as a value."""
    problem = case.problem
    plate = None if asked.in_space else flat_part(problem.mesh)
    _check_case(case, asked, plate)
    for name in asked.keep or ():
        check_known("patch", name, sorted(problem.mesh.patches))
    if asked.keep is None:
        asked = replace(asked, keep=_to_keep(problem))
    if plate is None:
        return _of_solid(case, asked, progress)
    return _of_sheet(case, asked, plate, progress)


def _check_case(case: Case, asked: Optimisation, plate: FlatPart | None) -> None:
    """Raise on a case that cannot be optimised by a method."""
    if not any(case.problem.loads.values()):
        raise InputError(f"'{case.name}' has no load, and nothing to be stiff against: add one")
    if case.problem.regions:
        raise InputError(
            f"'{case.name}' has regions of other materials, which would not know where they end: "
            "leave them out, and keep their places with --solid"
        )
    if asked.method == "somp" and plate is None:
        raise InputError(
            f"'{case.name}' is {'to be designed in space' if asked.in_space else 'no plate'}: SOMP "
            "turns the fibre in the plane of a prism along z: take --method simp"
        )


def _of_sheet(case: Case, asked: Optimisation, plate: FlatPart, progress: Progress) -> Optimised:
    """Optimise a flat part as a sheet."""
    problem, size = case.problem, asked.element_size
    size = float(np.sqrt(plate.planform.area / _CELLS)) if size is None else size
    check_number("element size", size, above=0.0, unit="mm")
    radius = _REACH * size if asked.radius is None else asked.radius
    stiffness = plane_stiffness(problem.material.stiffness)
    if asked.method == "somp":
        stiffness = _laminate(asked.laminate, stiffness)
    sheet, prism = sheet_problem(problem, plate, size, stiffness)
    full = _rims(problem, plate, asked.keep or (), size).union(area_of(asked.solid))
    empty = area_of(asked.void).difference(full)
    x, y = _middles(sheet.mesh.points, sheet.mesh.cells, prism)
    method: dict[str, Any] = {
        "radius": radius,
        "filter": asked.filter,
        "max_iterations": asked.max_iterations,
    }
    common: dict[str, Any] = {
        "weights": asked.weights,
        "groups": prism,
        "progress": progress,
        "solid": shapely.contains_xy(full, x, y),
        "void": shapely.contains_xy(empty, x, y),
    }
    if asked.method == "somp":
        somp = Somp(asked.volume_fraction, orientation=asked.orientation, **method)
        design = somp(sheet, stiffness, **common)
    else:
        design = Simp(asked.volume_fraction, minimum_stiffness=1e-6, **method)(sheet, **common)
    planform = sheet_outline(design, plate, size, full, empty)
    part = sheet_part(problem, plate, planform, min(size, _median_edge(problem)))
    return _result(case, part, design, size, planform, planform.area / plate.planform.area)


def _of_solid(case: Case, asked: Optimisation, progress: Progress) -> Optimised:
    """Optimise a part in space, on its own cells."""
    problem = case.problem
    mesh = problem.mesh if problem.mesh.order == 1 else problem.mesh.linear()
    whole = replace(problem, mesh=mesh, order=1, combinations={})
    size = _median_edge(whole)
    centres = mesh.centres
    full = cells_in(asked.solid, centres)
    for name in asked.keep or ():
        nodes = mesh.points[np.unique(mesh.patch(name))]
        full |= cKDTree(nodes).query(centres)[0] <= _RIM * size
    empty = cells_in(asked.void, centres) & ~full
    method = Simp(
        asked.volume_fraction,
        minimum_stiffness=1e-6,
        radius=max(3.0, 1.6 * size) if asked.radius is None else asked.radius,
        filter=asked.filter,
        max_iterations=asked.max_iterations,
    )
    design = method(whole, weights=asked.weights, solid=full, void=empty, progress=progress)
    part = as_problem(design, problem.material)
    part = replace(part, axes=None, order=problem.order, combinations=problem.combinations)
    share = float(part.mesh.volumes.sum() / mesh.volumes.sum())
    return _result(case, part, design, size, None, share)


def _result(
    case: Case, part: Problem, design: Design, size: float, planform: Any, share: float
) -> Optimised:
    """Gather the results, with remarks on them."""
    wanted, remarks = design.volume_fraction, []
    if not design.converged:
        remarks.append(
            f"not converged after {design.iterations} iterations (last change "
            f"{design.change[-1]:.2g}): raise --iterations"
        )
    if abs(share - wanted) > _AS_WANTED * wanted:
        remarks.append(
            f"the part fills {share:.3f} of the volume, not {wanted:.3f}: thin strips and pieces "
            "that carry no load were removed; a larger --radius leaves fewer of them"
        )
    new = replace(
        case,
        name=f"{case.name}-optimised",
        title=f"{case.title}, optimised",
        problem=part,
        findings=(),
    )
    return Optimised(new, design, size, planform, tuple(remarks))


def _laminate(given: Sequence[float] | None, stiffness: FloatArray) -> FloatArray:
    """Plane stress stiffness of the laminate: as given, of the part, or of the paper."""
    if given is not None:
        moduli = [*given[:2], *given[3:]]
        if len(given) != 4 or not np.isfinite(given).all() or min(moduli) <= 0.0:
            raise InputError(
                "a laminate is E1,E2,NU12,G12, moduli above 0 MPa; got "
                f"{','.join(f'{value:g}' for value in given)}: give these four numbers, or none "
                "for those of the part"
            )
        return plane_stress(*given)
    isotropic = np.isclose(stiffness[0, 0], stiffness[1, 1], rtol=1e-6) and np.isclose(
        stiffness[2, 2], 0.5 * (stiffness[0, 0] - stiffness[0, 1]), rtol=1e-6
    )
    return LAMINATE if isotropic else stiffness


def _to_keep(problem: Problem) -> tuple[str, ...]:
    """Patches that stay whole: loaded ones, and curved ones that hold the part."""
    loaded = set(patches_in_use((), problem.loads))
    mesh = problem.mesh
    for name in patches_in_use(problem.all_supports, {}):
        _, normal = mesh.facet_areas(mesh.patch(name))
        if np.linalg.norm(normal.mean(axis=0)) < 0.9:
            loaded.add(name)
    return tuple(sorted(loaded))


def _rims(problem: Problem, plate: FlatPart, keep: Sequence[str], size: float) -> Any:
    """Area beside patches that stays solid, mm."""
    traces = [plate.traces[name] for name in keep]
    walls = [trace.wall.buffer(_RIM * size) for trace in traces if not trace.wall.is_empty]
    areas = [face for trace in traces for face in trace.faces]
    whole = [area for area in areas if area.area > 0.99 * plate.planform.area]
    rims = shapely.union_all([*walls, *(area for area in areas if area not in whole)])
    return shapely.intersection(rims, plate.planform)


def _middles(points: FloatArray, cells: Any, prism: Any) -> tuple[FloatArray, FloatArray]:
    """Middle of the prism of each cell: x and y (m,)."""
    count = np.bincount(prism)
    x, y = (np.bincount(prism, points[cells][..., axis].mean(axis=1)) / count for axis in (0, 1))
    return x[prism], y[prism]


def _median_edge(problem: Problem) -> float:
    """Median edge length of a mesh, mm."""
    mesh = problem.mesh
    ends = mesh.points[mesh.corners[:, mesh.edges]]
    return float(np.median(np.linalg.norm(ends[..., 0, :] - ends[..., 1, :], axis=-1)))
