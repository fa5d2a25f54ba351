"""Isocurves of a scalar field that follows the tension: the method of Chen et al. 2021.

X. Chen, G. Fang, W.-H. Liao, C. C. L. Wang, Field-based toolpath generation for 3D printing
continuous fibre reinforced thermoplastic composites, Additive Manufacturing 49 (2021) 102470
(Chen et al. 2021). `Isocurve.literal` is the algorithm as printed; the defaults do better in the
measures of ``ccfem/papers/chen_2021``.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.isocontours import Isocontours
from ccfem.geometry.polylines import is_closed, middle_of_longest_run
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.fields.directed import Directed, directed
from ccfem.paths.fields.layer_elements import Surface
from ccfem.paths.fields.scalar import (
    extract_levels,
    fit_cone,
    fit_constrained,
    fit_literal,
    fit_weighted,
    unit_levels,
)
from ccfem.paths.fields.tensile import Incompatible, Tension, layer_tension, mesh_tension
from ccfem.paths.linking.finishing import (
    keep_off_border,
    lead_into,
    linked_paths,
    parallel_curve,
    trim_to_clearance,
)
from ccfem.paths.linking.joining import Joined
from ccfem.paths.linking.possible_links import ring_arc
from ccfem.paths.planning.infill import Turns, with_turns
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.planning.unfolding import unfolded
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, holes_on, stress_on

# Nested closed strands joined to one spiral, so that the fibre is cut once instead of for each.


_STRIDE = 4
"""Distance, in points, between the places of a ring that are tried for the seam."""


def spiral(
    lines: Sequence[FloatArray],
    limit: float,
    cost: Callable[[FloatArray], FloatArray],
    section: Region,
) -> list[FloatArray]:
    """Join nested closed lines to spirals.

    Each ring is opened beside the next, and a slanted piece leads from one to the other. The place
    is where `cost` along the outermost ring is least. The gap is two and a half times the local
    distance between the rings, so that the path turns by about 20 degrees only.

    Parameters
    ----------
    lines : sequence of (n_i, 2) arrays, mm
        Open ones are returned as they are.
    limit : float, mm
        Largest distance between rings that are joined.
    cost : callable
        Maps points (k, 2) to values (k,): the cost of disturbing the strand there.
    section : shapely (Multi)Polygon
        The connecting pieces stay inside it.

    Returns
    -------
    list of (n, 2) arrays
        First open lines in their order, then rings and spirals from the outside in.
    """
    closed = [k for k, line in enumerate(lines) if is_closed(line)]
    rings = [_counter_clockwise(lines[k]) for k in closed]
    kept = [line for k, line in enumerate(lines) if k not in set(closed)]
    obstacles = [shapely.linestrings(line) for line in kept]
    for chain in _nested_chains(rings, limit):
        left = []
        while chain:  # drop the innermost ring until the rest can be wound
            joined = _wind([rings[k] for k in chain], limit, cost)
            if joined is not None and _fits(joined, obstacles, section):
                kept.append(joined)
                break
            left.append(rings[chain.pop()])
        kept += left
    return kept


def _counter_clockwise(ring: FloatArray) -> FloatArray:
    x, y = ring.T
    return ring if float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) > 0.0 else ring[::-1]


def _nested_chains(rings: list[FloatArray], limit: float) -> list[list[int]]:
    """Chains of rings, each inside the one before and near to it, from the outside in."""
    areas = [shapely.Polygon(ring) for ring in rings]
    shapely.prepare(areas)
    chains: list[list[int]] = []
    for k in sorted(range(len(rings)), key=lambda k: -areas[k].area):
        around = [
            chain
            for chain in chains
            if shapely.contains(areas[chain[-1]], areas[k])
            and shapely.dwithin(areas[chain[-1]].exterior, areas[k].exterior, limit)
        ]
        if around:
            min(around, key=lambda chain: areas[chain[-1]].area).append(k)
        else:
            chains.append([k])
    return chains


def _wind(
    rings: list[FloatArray], limit: float, cost: Callable[[FloatArray], FloatArray]
) -> FloatArray | None:
    """Return one open line through all rings, or None if they are nowhere near enough."""
    if len(rings) < 2:
        return None
    strings = [shapely.LinearRing(ring) for ring in rings]
    places = rings[0][::_STRIDE]
    near = shapely.dwithin(strings[1], shapely.points(places), limit)
    if not near.any():
        return None
    # Where the outermost ring is near the next one, at the least cost; inwards the seam follows.
    seam = shapely.points(places[near][np.argmin(cost(places[near]))])
    pieces = []
    for k, string in enumerate(strings):
        neighbour = strings[k + 1] if k + 1 < len(strings) else strings[k - 1]
        # Open by two and a half times the distance to the next ring, so that the ramp is not steep.
        gap = 2.5 * float(shapely.distance(neighbour, seam))
        if gap > 2.5 * limit or gap > 0.5 * string.length:
            return None
        place = float(shapely.line_locate_point(string, seam))
        start = (place + 0.5 * gap) % string.length
        pieces.append(ring_arc(string, start, string.length - gap))
        if k + 1 < len(strings):
            seam = shapely.points(
                shapely.get_coordinates(shapely.shortest_line(strings[k + 1], seam))[0]
            )
    return np.concatenate(pieces)


def _fits(line: FloatArray, obstacles: list[shapely.LineString], section: Region) -> bool:
    string = shapely.linestrings(line)
    return bool(
        shapely.is_simple(string)
        and shapely.covers(section, string)
        and not shapely.intersects(string, obstacles).any()
    )


Field = Literal["layer", "mesh"]
Source = Literal["nodal", "cell"]
Sense = Literal["tensile", "absolute"]
Fill = Literal["screened", "laplacian"]
Fit = Literal["weighted", "literal"]
Spacing = Literal["constrained", "search", "cone"]

_LEAST_WEIGHT = 1e-3
_ROOM = 1.03
"""Least distance between isocurves in the fit, in strand widths. At exactly one width strands would
be trimmed wherever numerical error brings them slightly nearer."""
_TRIM = 0.98
"""Distance to a longer strand, in strand widths, below which a strand is cut. It is less than 1:
the chords of curves that run side by side at one width come slightly nearer."""
_PIECE = 3.0
"""Length, in strand widths, of the shortest pieces kept for linking."""
_SPIRAL_LIMIT = 4.0
"""Largest distance, in strand widths, between closed isocurves that are joined to a spiral."""

_LITERAL: Mapping[str, Any] = {
    "cap": 100.0,
    "floor": 0.0,
    "link_limit": 2.0,
    "conformal": "loaded",
    "stress": "cell",
    "field": "mesh",
    "incompatible": "any",
    "fill": "laplacian",
    "fit": "literal",
    "spacing": "search",
    "spiral": False,
    "boundary_links": False,
    "trim": False,
    "inset": 0.0,
    "smooth": False,
    "folds": True,
}


@dataclass(frozen=True)
class Isocurve:
    """Fibre along the tension; the larger the tension, the denser the strands.

    Attributes
    ----------
    cap : float, default 86
        Percentile (by area of the layer) of the stress that counts as the largest for the density.
        Otherwise one hot spot would set the spacing of the whole layer.
    floor : float, default 0.4
        Ends of isocurves are cut back to where the stress is at least this share of the cap.
    density : float > 0, default 1
        Sets how much fibre a layer gets: the density of strands where the stress is at the cap, 1
        being strands side by side. Elsewhere it scales with the stress to the `power`; it never
        exceeds 1. With ``spacing="search"`` the number of isocurves is scaled instead.
    power : float, default 1
        p of Eq. 5: the density is proportional to the stress to this power; 0 is uniform density.
    spacing_weight : float, default 0.1
        Weight of even spacing against alignment in the fit (``fit="weighted"``).
    fill_length : float, mm, default 1.5
        Length over which the screened fill carries the field on.
    link_limit : float, default 5
        Largest distance between two ends that are linked, in strand widths; 2 in the paper.
    rings : tuple of float, default (1.5, 2.5)
        Distances, in strand widths, of the curves round loaded and supported holes. The isocurves
        are led into the last one.
    conformal : tuple of str or "loaded", default ()
        Patches whose holes get such curves; "loaded" takes all that carry a load or a support. The
        paper leaves the choice to the user. In the virtual test these curves cost stiffness.
    stress : {"nodal", "cell"}
        Stress recovered at the nodes, or stress of the tetrahedra (the paper).
    field : {"layer", "mesh"}
        Tension in the plane of the layer, oriented there; or tension in space, oriented and
        filtered on the tetrahedra and then projected onto the layer (the paper).
    sense : {"tensile", "absolute"}
        Follow tension only; or follow the principal stress of largest absolute value.
    compression_limit : float, default 3
        mu of section 4.1: no tension is followed where compression is more than mu times larger.
    incompatible : {"any", "majority", "all", "none"}
        Filter of Eq. 2, for ``field="mesh"``.
    fill : {"screened", "laplacian"}
        One screened Poisson problem, or 50 steps of averaging (the paper, Eq. 3-4).
    fit : {"weighted", "literal"}
        `fields.scalar.fit_weighted` or `fit_literal` (the paper, Eq. 6).
    spacing : {"constrained", "search", "cone"}
        Bound the gradient in the fit so that unit levels lie at least a width apart; or search for
        the number of isocurves (the paper, section 4.3); or the same bound by an exact slow solver.
    spiral : bool, default True
        Join nested closed isocurves where the stress is least; not in the paper.
    boundary_links : bool, default True
        Links may follow the boundary; in the paper all are straight.
    trim : bool, default True
        Cut branches that come nearer than a strand's width to a longer one.
    inset : float, default 0.5
        Least distance between strands and the boundary, in strand widths. At 0.5 whole strands lie
        inside, and their ends still meet the links along the boundary. At 0 strands may run along
        the boundary with half their width outside.
    smooth : bool, default True
        Whether links keep the machine's minimum radius. Links with corners then join only strands
        too short to be cut alone, and are marked as links. Otherwise every link that is short
        enough is taken, as in the paper.
    turns : {"tight", "printable", "cut"}, default "tight"
        As in `Zigzag`.
    folds : bool, default False
        Whether strands may fold (`ccfem.paths.folds`), as in the paper. Otherwise they are led
        round folds where there is room, and cut there where there is none.
    """

    cap: float = 86.0
    floor: float = 0.4
    density: float = 1.0
    power: float = 1.0
    spacing_weight: float = 0.1
    fill_length: float = 1.5
    link_limit: float = 5.0
    rings: tuple[float, ...] = (1.5, 2.5)
    conformal: tuple[str, ...] | Literal["loaded"] = ()
    stress: Source = "nodal"
    field: Field = "layer"
    sense: Sense = "tensile"
    compression_limit: float = 3.0
    incompatible: Incompatible = "none"
    fill: Fill = "screened"
    fit: Fit = "weighted"
    spacing: Spacing = "constrained"
    spiral: bool = True
    boundary_links: bool = True
    trim: bool = True
    inset: float = 0.5
    smooth: bool = True
    turns: Turns = "tight"
    folds: bool = False

    amount: ClassVar[Amount] = Amount(
        "density", most=4.0, least=0.05, beyond=(("floor", 0.0), ("cap", 40.0))
    )
    in_plane: ClassVar[bool] = True
    by_layer: ClassVar[bool] = True
    variants: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "literal": _LITERAL,
        "border": {"inset": 0.0},
        "corners": {"smooth": False},
        "search": {"spacing": "search"},
        "cone": {"spacing": "cone"},
        "cut": {"turns": "cut"},
        "mesh": {
            "field": "mesh",
            "sense": "absolute",
            "incompatible": "majority",
            "conformal": "loaded",
        },
    }

    def __post_init__(self) -> None:
        check_choices(self)
        if isinstance(self.conformal, str) and self.conformal != "loaded":
            raise InputError(
                "isocurve.conformal must be 'loaded' or a list of patch names; got "
                f"{self.conformal!r}"
            )
        check_fields(self, "cap", above=0.0, at_most=100.0)
        check_fields(self, "density", above=0.0)
        weights = ("power", "spacing_weight", "fill_length", "link_limit", "inset")
        check_fields(self, *weights, at_least=0.0)

    @classmethod
    def literal(cls) -> "Isocurve":
        """Return the algorithm as printed in the paper."""
        return cls(**_LITERAL)

    def for_part(
        self, stress: PartStress, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Orient the field of the whole part, and check that there is any tension.

        Raises
        ------
        InputError
            When no layer has a tensile direction.
        """
        part = None
        if self.field == "mesh":
            part = mesh_tension(
                stress, self.stress, self.sense, self.compression_limit, self.incompatible
            )
        known: _Known = stress.__dict__.setdefault("isocurve_directions", {})
        planner = _Planner(self, part, known)
        if not any(
            planner.tension(layer, stress_on(layer, stress)).defined.any() for layer in layers
        ):
            largest = float(np.linalg.eigvalsh(stress.stress).max())
            raise InputError(
                "expected tension along which to lay fibre; the largest tensile stress found is "
                f"{largest:.3g} MPa, outweighed by compression: turn the load round, or plan with "
                "sense = 'absolute'"
            )
        return planner


_Known = dict[tuple[Any, ...], Directed]
"""Directions already computed for the layers of a part, by layer and the parameters they depend on.
They are reused when the part is planned again with more or less fibre."""
_KNOWN = 60
"""Layers whose directions are kept: those of one take megabytes."""


@dataclass(frozen=True)
class _Planner:
    """The strategy once it has seen the whole part."""

    strategy: Isocurve
    part: Tension | None
    known: _Known

    def tension(self, layer: Layer, stress: LayerStress) -> Tension:
        s = self.strategy
        if self.part is not None:
            return self.part.on(layer)
        return layer_tension(stress, s.stress, s.sense, s.compression_limit)

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        s = self.strategy
        # The stored value refers to its layer, so no other layer can get the same id.
        key: tuple[Any, ...] = (id(layer), s.cap, s.fill, s.fill_length, s.stress, s.field)
        key = (*key, s.sense, s.compression_limit, s.incompatible)
        potential = self.known.get(key)
        if potential is None:
            tension = self.tension(layer, stress)
            if not tension.defined.any():
                return Toolpaths.empty()
            potential = directed(layer, tension, s.cap, s.fill, s.fill_length)
            if len(self.known) < _KNOWN:
                self.known[key] = potential
        lines = self.isocurves(potential, machine.fibre_width)
        paths = self.connected(lines, layer, potential.tension, stress.held_or_loaded, machine)
        return Toolpaths.from_plane(paths.lines, layer, link=paths.link)

    def isocurves(self, directed: Directed, width: float) -> list[FloatArray]:
        """Isocurves of the field, at least a width apart."""
        s, surface, direction = self.strategy, directed.surface, directed.direction
        confidence = directed.confidence
        share = np.clip(directed.size / directed.cap, 1e-9, None)
        density = np.clip(s.density * share**s.power, None, 1.0)
        weight = np.maximum(confidence, _LEAST_WEIGHT)
        if s.spacing != "search":
            fit = fit_constrained if s.spacing == "constrained" else fit_cone
            room = _ROOM * width
            values = fit(surface, direction, density / room, weight, room, s.spacing_weight)
            return self.worthwhile(unit_levels(surface, values), surface, confidence)
        if s.fit == "literal":
            values = fit_literal(surface, density[:, None] * direction)
        else:
            values = fit_weighted(surface, direction, density, weight, s.spacing_weight)
        return self.worthwhile(
            extract_levels(surface, values, width / min(s.density, 1.0)), surface, confidence
        )

    def worthwhile(
        self, curves: Isocontours, surface: Surface, confidence: FloatArray
    ) -> list[FloatArray]:
        """Curves without their ends where the stress is below the floor."""
        if self.strategy.floor <= 0.0:
            return curves.lines()
        enough = curves.interpolate(surface.to_points(confidence)) >= self.strategy.floor
        kept = []
        for a, b in itertools.pairwise(curves.offsets):
            line, worth = curves.points[a:b], enough[a:b]
            if is_closed(line):
                # A closed curve that is mostly above the floor stays whole: its return anchors it.
                # Any other is opened in the middle of its longest stretch below the floor.
                if worth.mean() >= 0.5:
                    kept.append(line)
                    continue
                middle = middle_of_longest_run(~worth[:-1])
                line = np.roll(line[:-1], -middle, axis=0)
                worth = np.roll(worth[:-1], -middle)
            inside = np.flatnonzero(worth)
            if len(inside) > 1:
                kept.append(line[inside[0] : inside[-1] + 1])
        return kept

    def connected(
        self,
        lines: list[FloatArray],
        layer: Layer,
        tension: Tension,
        patches: tuple[str, ...],
        machine: Machine,
    ) -> Joined:
        """Rings round the chosen holes, isocurves led into them, and linked ends; short ones go."""
        s, width, section = self.strategy, machine.fibre_width, layer.plane.polygon
        rings: list[FloatArray] = []
        names = patches if s.conformal == "loaded" else s.conformal
        for hole in holes_on(layer, names) if s.rings else []:
            for distance in s.rings[:-1]:
                rings += parallel_curve(hole, distance * width, section)
            lines = lead_into(lines, hole, s.rings[-1] * width, section)
        rings = keep_off_border(rings, section, s.inset * width)
        lines = keep_off_border(lines, section, s.inset * width)
        if s.trim:
            lines = trim_to_clearance(
                [*rings, *lines], _TRIM * width, _PIECE * width, first=len(rings)
            )
        else:
            lines = [*rings, *lines]
        if s.spiral:
            lines = spiral(lines, _SPIRAL_LIMIT * width, _nearest(layer, tension.stress), section)
        if not s.folds:
            link = [np.zeros(len(line), dtype=bool) for line in lines]
            lines = unfolded(Joined(lines, link), section, machine, _PIECE * width).lines
        limit, least = s.link_limit * width, machine.shortest_strand
        radius = machine.minimum_radius if s.smooth else 0.0
        paths = linked_paths(lines, section, width, limit, least, s.boundary_links, radius)
        return with_turns(s, paths.lines, machine, paths.link)


def _nearest(layer: Layer, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a function that gives points (k, 2) the value of the nearest triangle."""
    tree = cKDTree(layer.plane.points[layer.triangles].mean(axis=1))
    return lambda points: values[tree.query(points)[1]]
