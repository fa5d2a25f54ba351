"""Constraints of a deck: *TRANSFORM, *COUPLING, *RIGID BODY and *TIE.

A reference node moves the faces coupled to it as a rigid body (*KINEMATIC, *RIGID BODY), or what
acts on it is spread over them (*DISTRIBUTING). A *TIE joins surfaces: where their meshes coincide
their nodes become the same, else those of one follow the faces of the other. What no means of the
solver takes is a mistake, with its line.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import FARTHEST
from ccfem.base.errors import InputError, shown
from ccfem.body.files.cells import SplitCells, outside, tetrahedra
from ccfem.body.files.deck import (
    ELEMENTS,
    NODES,
    Block,
    Deck,
    Model,
    Scope,
    chosen_rows,
    listed,
    moved,
)
from ccfem.body.files.formats.inp import facets_of_surface
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.deck_materials import TAKE_OUT, DeckReading, check_parameters, numbers
from ccfem.fem.elasticity.support_kinds import local_axes
from ccfem.fem.elasticity.tied_faces import tied_nodes
from ccfem.geometry.facets import are_among, connected

DEGREES = "xyzuvw"
"""Degrees of freedom 1 to 6: displacements along x, y and z, and rotations about them."""
_SAME = 1e-6
"""Distance of two nodes over the size of the part within which they coincide."""
_SYSTEMS: dict[str, Literal["rectangular", "cylindrical"]] = {
    "R": "rectangular",
    "C": "cylindrical",
}


@dataclass(frozen=True)
class LocalSystem:
    """Axes of a *TRANSFORM: see `ccfem.fem.elasticity.support_kinds.LocalSupport`."""

    system: Literal["rectangular", "cylindrical"]
    points: FloatArray  # (2, 3): in the unit of the deck

    def at(self, places: FloatArray) -> FloatArray:
        """Axes (k, 3, 3) as columns at places (k, 3)."""
        return local_axes(self.system, self.points, places)


@dataclass(frozen=True)
class Coupling:
    """Faces (k, 3) that hang on a reference node."""

    title: str
    facets: IntArray
    place: FloatArray  # (3,): of the reference node, in the unit of the deck
    rigid: bool  # whether they move with it as a rigid body; else it passes loads on alone
    components: str = "xyz"  # in which they move with it

    def held(self, at: Mapping[str, float]) -> dict[str, float] | None:
        """Displacement of its faces by component where its node is held; None for "xyz".

        Parameters
        ----------
        at : mapping of degree of freedom to value
            At which the reference node is held.

        Raises
        ------
        InputError
            Where single components follow a node that is free, or turns.
        """
        if self.components == "xyz":
            return None
        turns = {DEGREES[3 + k] for k in range(3) if set(self.components) - {DEGREES[k]}}
        needed = {*self.components, *turns}
        if not needed <= set(at) or any(at[letter] for letter in turns):
            free = ", ".join(str(1 + DEGREES.index(letter)) for letter in sorted(needed - set(at)))
            raise InputError(
                f"single components of '{self.title}' follow a reference node that is "
                f"{f'free in {free}' if free else 'turned'}, and it must be held there: {TAKE_OUT}"
            )
        return {letter: at[letter] for letter in self.components}


class DeckConstraints:
    """Systems and couplings of a deck, as their keywords come by.

    Attributes
    ----------
    border : (b, 3) int array
        Facets of the outside.
    system_of : (n,) int array
        System of the components of each node; -1 for those of the space.
    reference : dict of int to (int, int)
        Coupling of each reference node, and the number of its first degree of freedom: 0, or 3 of a
        node whose displacements stand for rotations.
    """

    KEYWORDS = ("TRANSFORM", "COUPLING", "KINEMATIC", "DISTRIBUTING", "RIGID BODY", "TIE")

    def __init__(self, reading: DeckReading, mesh: TetMesh) -> None:
        self._reading, self._mesh = reading, mesh
        self.border = outside(mesh)
        self.systems: list[LocalSystem] = []
        self.system_of = np.full(len(mesh.points), -1)
        self.couplings: list[Coupling] = []
        self.reference: dict[int, tuple[int, int]] = {}
        self._open: Block | None = None

    def take(self, block: Block, scope: Scope) -> None:
        """Take a keyword of `KEYWORDS`; what is wrong with it is noted."""
        with self._reading.noted(block):
            if block.keyword in ("KINEMATIC", "DISTRIBUTING"):
                self._couple(block)
            elif block.keyword == "COUPLING":
                self.end()
                self._open = block
            elif block.keyword == "RIGID BODY":
                self._rigid_body(block)
            elif block.keyword == "TRANSFORM":
                self._transform(block, scope)

    def end(self) -> None:
        """Close a *COUPLING that no *KINEMATIC or *DISTRIBUTING followed."""
        block, self._open = self._open, None
        if block is not None:
            with self._reading.noted(block):
                raise InputError("it needs *KINEMATIC or *DISTRIBUTING below it: add one")

    def apart(
        self, nodes: IntArray, in_cell: BoolArray
    ) -> tuple[list[tuple[IntArray, int]], IntArray]:
        """Tell reference nodes, with the number of their first degree, from nodes of cells."""
        known = [node for node in nodes.tolist() if node in self.reference]
        references = [(np.array([node]), self.reference[node][1]) for node in known]
        return references, nodes[in_cell[nodes]]

    def degrees(self, letters: str, offset: int) -> str:
        """Degrees of freedom of a reference node whose first one has a number."""
        places = [offset + DEGREES.index(letter) for letter in letters]
        if max(places) >= len(DEGREES):
            raise InputError(f"a ROT NODE has degrees of freedom 1 to 3: {TAKE_OUT}")
        return "".join(DEGREES[place] for place in places)

    def _refer(self, item: str, coupling: Coupling, offset: int = 0) -> None:
        """Note the reference node of a coupling."""
        nodes = self._reading.nodes(item)
        if len(nodes) != 1:
            raise InputError(f"expected one reference node; got {shown(item)}: name one")
        node = int(nodes[0])
        if (self._mesh.cells == node).any() or node in self.reference:
            raise InputError(
                f"reference node {shown(item)} belongs to a solid or another coupling: {TAKE_OUT}"
            )
        if self.system_of[node] >= 0:
            raise InputError(f"*TRANSFORM of a reference node is not followed: {TAKE_OUT}")
        if offset == 0:
            self.couplings.append(coupling)
        self.reference[node] = len(self.couplings) - 1, offset

    def _place(self, item: str) -> FloatArray:
        """Place (3,) of a reference node."""
        place = self._reading.model.points[self._reading.nodes(item)[0]]
        if not (np.abs(place) <= FARTHEST).all():
            raise InputError(
                f"a reference node must lie within {FARTHEST:g}; got {place.tolist()}: correct it"
            )
        return np.asarray(place)

    def _couple(self, block: Block) -> None:
        """Take a *KINEMATIC or a *DISTRIBUTING with the *COUPLING above it."""
        coupling, self._open = self._open, None
        if coupling is None:
            raise InputError(f"it stands below no *COUPLING: {TAKE_OUT}")
        known = ("CONSTRAINT NAME", "REF NODE", "SURFACE", "INFLUENCE RADIUS", "ALPHA")
        check_parameters(coupling, *known)
        radius = coupling.parameters.get("INFLUENCERADIUS", "WHOLE SURFACE").upper()
        if radius != "WHOLE SURFACE":
            raise InputError(f"INFLUENCE RADIUS={radius} is not followed: {TAKE_OUT}")
        rigid = block.keyword == "KINEMATIC"
        check_parameters(block, *(() if rigid else ("WEIGHTING METHOD", "COUPLING")))
        if block.parameters.get("WEIGHTINGMETHOD", "UNIFORM").upper() != "UNIFORM":
            raise InputError(f"weights other than uniform ones are not followed: {TAKE_OUT}")
        coupled = set()
        for number, items in self._reading.lines(block):
            with self._reading.noted(block, number):
                first, last = numbers([*items, "", ""], 2)
                last = last or first
                if not 1 <= first <= last <= len(DEGREES) or first % 1 or last % 1:
                    raise InputError(
                        f"degrees of freedom are 1 to {len(DEGREES)}; got "
                        f"{shown(', '.join(items))}: correct them"
                    )
                coupled |= set(range(int(first), int(last) + 1))
        components = "".join(DEGREES[k - 1] for k in sorted(coupled & {1, 2, 3}))
        if rigid and coupled and not components:
            raise InputError(
                f"solids have degrees of freedom 1 to 3; got {sorted(coupled)}: couple one of them"
            )
        name, item = (coupling.parameters.get(key, "") for key in ("SURFACE", "REFNODE"))
        facets = facets_of_surface(self._reading.model, name, self.border)
        facets = self.border[are_among(self.border, facets)]
        if not len(facets):
            raise InputError(f"surface {shown(name)} has no face on the outside: {TAKE_OUT}")
        followed = components or "xyz"
        self._refer(item, Coupling(name, facets, self._place(item), rigid, followed))

    def _rigid_body(self, block: Block) -> None:
        """Take a *RIGID BODY of nodes that make faces."""
        check_parameters(block, "NSET", "TIE NSET", "ELSET", "REF NODE", "ROT NODE", "ISOTHERMAL")
        parameters, model = block.parameters, self._reading.model
        name = parameters.get("NSET") or parameters.get("TIENSET") or parameters.get("ELSET", "")
        kind = ELEMENTS if "ELSET" in parameters else NODES
        rows = chosen_rows(model, "", NODES, [listed(kind, [name])])
        inside = np.zeros(len(self._mesh.points), dtype=bool)
        inside[rows] = True
        facets = self.border[inside[self.border].all(axis=1)]
        inside[self._mesh.facet_nodes(facets)] = False
        item = parameters.get("REFNODE", "")
        place = self._place(item)
        inside[self._reading.nodes(item)] = False
        if inside.any() or not len(facets):
            raise InputError(
                f"a rigid body is followed where its nodes make faces of the outside; "
                f"{np.count_nonzero(inside)} nodes of {shown(name)} do not: {TAKE_OUT}"
            )
        coupling = Coupling(name, facets, place, rigid=True)
        self._refer(item, coupling)
        if "ROTNODE" in parameters:
            self._refer(parameters["ROTNODE"], coupling, offset=3)

    def _transform(self, block: Block, scope: Scope) -> None:
        """Take a *TRANSFORM: axes of the components of the nodes of a set."""
        check_parameters(block, "NSET", "TYPE")
        kind = block.parameters.get("TYPE", "R").upper()
        if kind not in _SYSTEMS:
            raise InputError(f"TYPE={kind} is not followed, R and C are: {TAKE_OUT}")
        items = [item for line in block.lines for item in line.split(",")]
        points = np.reshape(numbers(items, 6)[:6], (2, 3))
        name = block.parameters.get("NSET", "")
        for key in self._reading.scopes_of(scope):
            nodes = chosen_rows(self._reading.model, key, NODES, [listed(NODES, [name])])
            moves = self._reading.model.scopes[key].moves
            here = moved(points, moves)
            if kind == "R":
                here = here - moved(np.zeros((1, 3)), moves)
            system = LocalSystem(_SYSTEMS[kind], here)
            system.at(np.zeros((0, 3)))  # that there are axes
            if any(node in self.reference for node in nodes.tolist()):
                raise InputError(f"*TRANSFORM of a reference node is not followed: {TAKE_OUT}")
            self.systems.append(system)
            self.system_of[nodes] = len(self.systems) - 1


# Surfaces that are tied.


@dataclass(frozen=True)
class Tie:
    """Two surfaces of a *TIE, whose meshes do not match, by their facets (k, 3)."""

    titles: tuple[str, str]
    slave: IntArray
    master: IntArray
    within: float | None  # distance up to which nodes are tied, in the unit of the deck


@dataclass
class TiedModel:
    """A model whose tied surfaces share their nodes where their meshes match."""

    model: Model
    cells: SplitCells
    ties: list[Tie]  # the other ones
    mistakes: list[str]
    remarks: list[str]


def tied(model: Model, deck: Deck, path: Path) -> TiedModel:
    """Take the *TIE of a deck: the facets of surfaces that do not match are those of its cells."""
    cells = tetrahedra(model.points, model.blocks, path)
    result = TiedModel(model, cells, [], [], [])
    before = TetMesh(cells.points, cells.cells)
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for block in (block for block, _ in deck.rest if block.keyword == "TIE"):
        try:
            known = ("NAME", "POSITION TOLERANCE", "ADJUST", "TYPE", "NO ROTATION")
            check_parameters(block, *known)
            given = numbers([block.parameters.get("POSITIONTOLERANCE", "")], 1)[0]
            for line in block.lines:
                tie = _tie(model, before, [x.strip() for x in line.split(",")], given or None)
                same = _coinciding(model, before, tie)
                if same is None:
                    result.ties.append(tie)
                    result.remarks.append(f"{block.where}: *TIE: {_followed(before, tie)}")
                    continue
                pairs.append(same)
                result.remarks.append(f"{block.where}: *TIE glues {len(same)} coinciding nodes")
        except InputError as error:
            result.mistakes.append(f"{block.where}: *TIE: {error}")
    if len(pairs) == 1:
        return result
    piece = connected(np.concatenate(pairs), len(model.points))
    _, first = np.unique(piece, return_index=True)
    leader = first[piece]
    result.model = _renumbered(model, leader)
    result.cells = tetrahedra(result.model.points, result.model.blocks, path)
    whole = np.arange(len(cells.points))
    whole[: len(leader)] = leader
    result.ties = [
        replace(tie, slave=whole[tie.slave], master=whole[tie.master]) for tie in result.ties
    ]
    return result


def _tie(model: Model, mesh: TetMesh, names: list[str], within: float | None) -> Tie:
    """Faces of the outside of two surfaces."""
    if len(names) < 2:
        raise InputError(f"expected two surfaces; got {shown(', '.join(names))}: name two")
    border, faces = outside(mesh), []
    for name in names[:2]:
        facets = facets_of_surface(model, name, border)
        faces.append(border[are_among(border, facets)])
        if not len(faces[-1]):
            raise InputError(f"surface {shown(name)} has no face on the outside: {TAKE_OUT}")
    slave, master = faces
    return Tie((names[0], names[1]), slave, master, within)


def _followed(mesh: TetMesh, tie: Tie) -> str:
    """Say how many nodes of one surface follow the faces of the other."""
    (slave, master), nodes = tie.titles, np.unique(mesh.facet_nodes(tie.slave))
    joined = tied_nodes(mesh, nodes, tie.master, tie.within, f"'{slave}'")
    return (
        f"{len(joined.nodes)} of {len(nodes)} nodes of '{slave}' follow the faces of '{master}', "
        "whose mesh is another one"
    )


def _coinciding(model: Model, mesh: TetMesh, tie: Tie) -> IntArray | None:
    """Pairs (k, 2) of the nodes of two surfaces that coincide; None where their faces do not."""
    slave, master = (
        np.unique(nodes[nodes < len(model.points)])
        for nodes in map(mesh.facet_nodes, (tie.slave, tie.master))
    )
    places = model.points[np.concatenate([slave, master])]
    near = _SAME * float(np.linalg.norm(np.ptp(places, axis=0)))
    distance, at = cKDTree(model.points[master]).query(model.points[slave])
    same = distance <= near
    # The smaller surface lies on faces of the larger one.
    leader = np.arange(len(mesh.points))
    leader[slave[same]] = master[at[same]]
    few, many = leader[tie.slave], tie.master
    if len(few) > len(many):
        few, many = many, few
    if not are_among(few, many).all():
        return None
    return np.column_stack([slave[same], master[at[same]]])


def _renumbered(model: Model, leader: IntArray) -> Model:
    """Model in which each node is that which leads it."""
    rows = {
        key: replace(known, rows=leader[known.rows]) if key[0] == NODES else known
        for key, known in model.rows.items()
    }
    nodes = np.where(model.nodes >= 0, leader[model.nodes], -1)
    return replace(
        model,
        blocks=[(kind, leader[at] if at.size else at) for kind, at in model.blocks],
        rows=rows,
        nodes=nodes,
    )
