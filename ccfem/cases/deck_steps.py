"""What acts in the steps of a deck: *BOUNDARY, *CLOAD, *DLOAD, *DSLOAD, *TEMPERATURE and *STEP.

Loads and supports go on from step to step as in Abaqus and CalculiX: a step changes what it names
(of loads what acts on the same node and direction, or on the same face), unless OP=NEW takes
everything away; within a step loads add up. A linear perturbation has the supports of the step
before, at rest, and its own loads alone.

A keyword, parameter or value that changes a linear static answer and is not followed is a mistake,
with its line; so is every keyword that is not known. What belongs to other answers (NLGEOM,
*PLASTIC) is left out, and said.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError, shown
from ccfem.body.files.deck import Block, element_faces
from ccfem.body.files.formats.inp import facets_of_surface
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.deck_constraints import DEGREES, DeckConstraints
from ccfem.cases.deck_materials import TAKE_OUT, DeckReading, check_count, check_parameters, numbers
from ccfem.fem.elasticity.load_kinds import Vector
from ccfem.geometry.facets import are_among

# What each keyword is to a linear static analysis.


_NOTHING = {
    *("HEADING", "PREPRINT", "RESTART", "CONTROLS", "TIME POINTS", "MONITOR", "FILE FORMAT"),
    *("OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT", "ENERGY OUTPUT"),
    *("NODE PRINT", "EL PRINT", "CONTACT PRINT", "ENERGY PRINT", "SECTION PRINT", "ENERGY FILE"),
    *("NODE FILE", "EL FILE", "ELEMENT FILE", "CONTACT FILE", "NO PRINT", "PRINT", "DIAGNOSTICS"),
    *("SURFACE INTERACTION", "SURFACE BEHAVIOR", "FRICTION", "CONTACT CONTROLS", "GAP HEAT"),
    *("CONDUCTIVITY", "SPECIFIC HEAT", "PHYSICAL CONSTANTS", "SECTION CONTROLS", "END STEP"),
    *("END ASSEMBLY", "END PART", "END INSTANCE"),
    *("HOURGLASS STIFFNESS", "INTEGRATED OUTPUT", "FILTER", "SOLUTION TECHNIQUE"),
}
"""Keywords without effect on a linear static answer."""
_LINEAR = {
    *("PLASTIC", "CYCLIC HARDENING", "CREEP", "VISCO", "VISCOELASTIC", "RATE DEPENDENT"),
    *("DAMPING", "DAMAGE INITIATION", "DAMAGE EVOLUTION"),
}
"""Keywords that belong to other answers than the linear static one."""
_PROCEDURES = {
    *("FREQUENCY", "BUCKLE", "DYNAMIC", "MODAL DYNAMIC", "STEADY STATE DYNAMICS", "VISCO"),
    *("COMPLEX FREQUENCY", "HEAT TRANSFER", "COUPLED TEMPERATURE-DISPLACEMENT", "GREEN"),
    *("UNCOUPLED TEMPERATURE-DISPLACEMENT", "RANDOM RESPONSE", "RESPONSE SPECTRUM", "GEOSTATIC"),
    *("ELECTROMAGNETICS", "SENSITIVITY", "SUBSTRUCTURE GENERATE", "COMPLEX FREQUENCY", "SOILS"),
}
"""Procedures of steps that are left out."""
_ACTING = ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE")
"""Keywords of what acts on a part."""
_HELD = {
    "ENCASTRE": "xyzuvw",
    "PINNED": "xyz",
    "XSYMM": "xvw",
    "YSYMM": "yuw",
    "ZSYMM": "zuv",
    "XASYMM": "yzu",
    "YASYMM": "xzv",
    "ZASYMM": "xyw",
}
"""Degrees of freedom that named boundary conditions hold; solids have no rotations."""
_FACE = {f"P{k}": f"S{k}" for k in range(1, 7)}
_NUMBERS = {"GRAV": 4, "CENTRIF": 7}
"""Numbers of loads on the volume that have more than one."""
BODY = {"BX": 0, "BY": 1, "BZ": 2}


# What acts at some time of the analysis.


class Hold(NamedTuple):
    """A line of *BOUNDARY: letters of `DEGREES`, rotations on reference nodes alone."""

    title: str
    nodes: IntArray
    components: str
    value: float


class NodeLoad(NamedTuple):
    """A line of *CLOAD: a place in `DEGREES`, moments on reference nodes alone."""

    nodes: IntArray
    component: int
    value: float
    step: int


class FaceLoad(NamedTuple):
    """A pressure, or a traction along a vector, on facets (k, 3)."""

    title: str
    facets: IntArray
    size: float
    vector: Vector | None
    step: int
    keyword: str


class BodyLoad(NamedTuple):
    """A load on the volume of cells (k,): its label, numbers, and the line that gives it."""

    label: str
    cells: IntArray
    numbers: tuple[float, ...]
    step: int
    line: int


@dataclass(frozen=True)
class State:
    """What acts at the end of a step."""

    holds: tuple[Hold, ...] = ()
    nodes: tuple[NodeLoad, ...] = ()
    faces: tuple[FaceLoad, ...] = ()
    bodies: tuple[BodyLoad, ...] = ()
    warmth: FloatArray | None = None


_MORE = {"BOUNDARY": ("TYPE",), "DSLOAD": ("FOLLOWER", "CONSTANT RESULTANT")}
"""Further parameters that are followed, or change nothing in a linear analysis."""


@dataclass
class DeckStep:
    """A step while it is read."""

    block: Block
    name: str
    number: int
    state: State
    static: bool = False
    procedure: str = ""
    period: float = 1.0
    acts: bool = False
    changed: set[str] = field(default_factory=set)

    @property
    def perturbs(self) -> bool:
        """Whether it is a linear perturbation."""
        return "PERTURBATION" in self.block.parameters


class DeckSteps:
    """Supports, loads and steps of a deck, as its keywords come by."""

    def __init__(self, reading: DeckReading, mesh: TetMesh, constraints: DeckConstraints) -> None:
        self.reading, self.mesh, self.constraints = reading, mesh, constraints
        self.border = constraints.border
        self.in_cell = np.zeros(len(mesh.points), dtype=bool)
        self.in_cell[mesh.cells] = True
        self._state = State()
        self.initial: FloatArray | None = None
        self._amplitudes: dict[str, Block] = {}
        self._step: DeckStep | None = None
        self.ended: list[DeckStep] = []
        self._skipped: DeckStep | None = None

    # Keywords.

    def take(self, block: Block) -> None:
        """Take over a keyword that is not one of materials."""
        parameters = block.parameters
        match block.keyword:
            case "STEP":
                self.end_step()
                self._begin(block)
            case "STATIC":
                self._static(block)
            case "END STEP":
                self.end_step()
            case "AMPLITUDE":
                self._amplitudes[parameters.get("NAME", "").upper()] = block
            case "INITIAL CONDITIONS":
                check_parameters(block, "TYPE")
                if parameters.get("TYPE", "").upper() != "TEMPERATURE":
                    raise InputError(f"only TYPE=TEMPERATURE is followed: {TAKE_OUT}")
                self.initial = self._warmed(block, self.initial, 1.0)
            case keyword if keyword in _ACTING:
                self._acting(block)
            case keyword if self._step is not None and keyword in _PROCEDURES:
                self._step.procedure = keyword
            case keyword if keyword in _LINEAR:
                self.reading.remark(block, "is left out: the part is linear and elastic")
            case keyword if keyword not in _NOTHING:
                raise InputError(f"it is not taken over: {TAKE_OUT}")

    def _begin(self, block: Block) -> None:
        """Open a step."""
        known = ("NAME", "NLGEOM", "INC", "PERTURBATION", "AMPLITUDE", "UNSYMM", "SOLVER")
        number = len(self.ended) + 1
        name = block.parameters.get("NAME") or f"step_{number}"
        self._step = DeckStep(block, name, number, self._state)
        check_parameters(block, *known, "EXTRAPOLATION", "CONVERT SDI", "TIME RESET")
        if self._step.perturbs:
            holds = tuple(hold._replace(value=0.0) for hold in self._state.holds)
            self._step.state = State(holds)
            if number > 1:
                self.reading.remark(block, "PERTURBATION is taken as a load of its own alone")
        if block.parameters.get("NLGEOM", "NO").upper() not in ("NO", "OFF"):
            self.reading.remark(block, "is solved as a linear one, without NLGEOM")

    def _static(self, block: Block) -> None:
        """Note that the open step is static, and how long it lasts."""
        known = ("SOLVER", "DIRECT", "TIME RESET", "TOTAL TIME AT START", "STABILIZE")
        if self._step is None:
            raise InputError("it stands in no *STEP: open one above it")
        self._step.static = True
        check_parameters(block, *known, "ALLSDTOL", "CONTINUE", "FACTOR")
        if block.lines:
            self._step.period = numbers(block.lines[0].split(","), 2)[1] or 1.0

    def end_step(self) -> None:
        """Close the step that is open, if any."""
        step, self._step = self._step, None
        if step is None:
            return
        self.ended.append(step)
        where = f"{step.block.where}: *STEP '{step.name}'"
        if step.static:
            if self._skipped is not None:
                self.reading.mistakes.lines.append(
                    f"{where} follows '{self._skipped.name}', whose supports and loads are not "
                    f"followed: {TAKE_OUT}"
                )
            if not step.perturbs:
                self._state = step.state
            return
        if not step.procedure:
            self.reading.mistakes.lines.append(f"{where} has no *STATIC: give it its procedure")
            return
        self.reading.remarks.append(f"{where} is left out: *{step.procedure} is no static step")
        self._skipped = step if step.acts else self._skipped

    def _acting(self, block: Block) -> None:
        """Take over supports, loads or temperatures."""
        step, keyword = self._step, block.keyword
        if step is None and keyword != "BOUNDARY":
            raise InputError("it stands in no *STEP: put it below one")
        if step is not None and step.procedure:
            step.acts = True
            return
        check_parameters(block, "OP", "AMPLITUDE", *_MORE.get(keyword, ()))
        state = self._state if step is None else step.state
        operation = block.parameters.get("OP", "MOD").upper()
        if operation not in ("MOD", "NEW"):
            raise InputError(f"OP is MOD or NEW; got {shown(operation)}: write one of them")
        if step is not None and operation == "NEW" and keyword not in step.changed:
            state = self._without(state, keyword)
        if step is not None:
            step.changed.add(keyword)
        factor = self._factor(block)
        now = step.number if step is not None else 0
        match keyword:
            case "BOUNDARY":
                kind = block.parameters.get("TYPE", "DISPLACEMENT").upper()
                if kind != "DISPLACEMENT":
                    raise InputError(f"TYPE={kind} is not followed: {TAKE_OUT}")
                holds = tuple(self._holds(block, factor))
                state = replace(state, holds=(*state.holds, *holds))
            case "CLOAD":
                nodes = tuple(self._node_loads(block, factor, now))
                state = replace(state, nodes=(*state.nodes, *nodes))
            case "DLOAD" | "DSLOAD":
                state = self._distributed(block, state, factor, now)
            case _:
                if step is not None and step.perturbs:
                    raise InputError(f"in a perturbation it is not followed: {TAKE_OUT}")
                warmth = self.initial if state.warmth is None else state.warmth
                state = replace(state, warmth=self._warmed(block, warmth, factor))
        if step is None:
            self._state = state
        else:
            step.state = state

    def _without(self, state: State, keyword: str) -> State:
        """Take away what a keyword gave in earlier steps."""
        faces = tuple(load for load in state.faces if load.keyword != keyword)
        return {
            "BOUNDARY": replace(state, holds=()),
            "CLOAD": replace(state, nodes=()),
            "DLOAD": replace(state, faces=faces, bodies=()),
            "DSLOAD": replace(state, faces=faces),
            "TEMPERATURE": replace(state, warmth=None),
        }[keyword]

    def _factor(self, block: Block) -> float:
        """Value of the amplitude of a keyword at the end of the step; 1 without."""
        name = block.parameters.get("AMPLITUDE", "")
        if not name:
            return 1.0
        if name.upper() not in self._amplitudes or self._step is None:
            raise InputError(f"the deck has no *AMPLITUDE {shown(name)} for it: {TAKE_OUT}")
        amplitude = self._amplitudes[name.upper()]
        check_parameters(amplitude, "NAME", "DEFINITION", "TIME", "VALUE")
        known = {"DEFINITION": "TABULAR", "TIME": "STEP TIME", "VALUE": "RELATIVE"}
        for key, wanted in known.items():
            given = amplitude.parameters.get(key, wanted).upper()
            later = key != "TIME" or self._step.number > 1
            if given != wanted and (later or given != "TOTAL TIME"):
                raise InputError(f"{key}={given} of its amplitude is not followed: {TAKE_OUT}")
        items = [item for line in amplitude.lines for item in line.rstrip(", ").split(",")]
        pairs = np.reshape(numbers([*items, *[""] * (len(items) % 2)], len(items)), (-1, 2))
        if not len(pairs) or (np.diff(pairs[:, 0]) < 0.0).any():
            raise InputError("its amplitude needs pairs of time and value in order: write some")
        return float(np.interp(self._step.period, *pairs.T))

    # Data lines.

    def _holds(self, block: Block, factor: float) -> Iterator[Hold]:
        """Components that the lines of a *BOUNDARY hold."""
        for number, items in self.reading.lines(block):
            with self.reading.noted(block, number):
                check_count(items, 4)
                nodes = self.reading.nodes(items[0])
                kind = items[1].upper() if len(items) > 1 else ""
                value = 0.0
                if kind in _HELD:
                    letters = _HELD[kind]
                else:
                    first, last, value = numbers([*items[1:4], "", ""], 3)
                    last = last or first
                    if not 1 <= first <= last <= len(DEGREES) or first % 1 or last % 1:
                        raise InputError(
                            f"degrees of freedom are 1 to {len(DEGREES)}, or one of "
                            f"{', '.join(_HELD)}; got {shown(', '.join(items[1:3]))}: {TAKE_OUT}"
                        )
                    letters = DEGREES[int(first) - 1 : int(last)]
                title = f"line {block.number}" if items[0].isdecimal() else items[0]
                references, chosen = self.constraints.apart(nodes, self.in_cell)
                for node, offset in references:
                    here = self.constraints.degrees(letters, offset)
                    # Displacements are lengths, rotations are not.
                    for part, unit in (("xyz", self.reading.scale), ("uvw", 1.0)):
                        held = "".join(letter for letter in here if letter in part)
                        if held:
                            yield Hold(title, node, held, value * factor * unit)
                if len(chosen) and value and set(letters) - set("xyz"):
                    raise InputError(f"solids have no rotations to be given: {TAKE_OUT}")
                loose = len(nodes) - len(references) - len(chosen)
                if loose:
                    self.reading.remark(block, f"holds {loose} nodes of no solid in vain")
                letters = "".join(letter for letter in letters if letter in "xyz")
                if letters and len(chosen):
                    yield Hold(title, chosen, letters, value * factor * self.reading.scale)

    def _node_loads(self, block: Block, factor: float, now: int) -> Iterator[NodeLoad]:
        """Read the forces of the lines of a *CLOAD."""
        for number, items in self.reading.lines(block):
            with self.reading.noted(block, number):
                check_count(items, 3)
                nodes = self.reading.nodes(items[0])
                component, value = numbers(items[1:3], 2)
                if component % 1 or not 1 <= component <= len(DEGREES):
                    raise InputError(
                        f"forces and moments are 1 to {len(DEGREES)}; got {shown(items[1])}: "
                        f"{TAKE_OUT}"
                    )
                references, chosen = self.constraints.apart(nodes, self.in_cell)
                for node, offset in references:
                    for letter in self.constraints.degrees(DEGREES[int(component) - 1], offset):
                        yield NodeLoad(node, DEGREES.index(letter), value * factor, now)
                if len(chosen) and component > 3:
                    raise InputError(
                        f"forces act along 1, 2 or 3, and solids take no moments; got "
                        f"{shown(items[1])}: {TAKE_OUT}"
                    )
                if len(references) + len(chosen) < len(nodes):
                    raise InputError(f"{shown(items[0])} has nodes of no solid: {TAKE_OUT}")
                if len(chosen):
                    yield NodeLoad(chosen, int(component) - 1, value * factor, now)

    def _distributed(self, block: Block, state: State, factor: float, now: int) -> State:
        """Add the lines of a *DLOAD or a *DSLOAD to what acts."""
        faces, bodies = state.faces, state.bodies
        for number, chosen, label, rest in self._distributed_lines(block, factor):
            with self.reading.noted(block, number):
                if block.keyword == "DSLOAD":
                    load = self._on_surface(chosen[0], label, rest, now)
                elif label in _FACE:
                    rows, _ = self.reading.cells(chosen)
                    facets = element_faces(self.reading.model, rows, _FACE[label])
                    title = f"line {number}" if chosen[0].isdecimal() else f"{chosen[0]} {label}"
                    load = self._face_load(title, facets, rest[0], None, now, "DLOAD")
                else:
                    bodies = self._on_body(chosen, label, rest, bodies, now, number)
                    continue
                # What an earlier step put on the same facets is replaced.
                kept = [
                    old._replace(facets=old.facets[~are_among(old.facets, load.facets)])
                    if old.step < now
                    and old.keyword == load.keyword
                    and (old.vector is None) == (load.vector is None)
                    else old
                    for old in faces
                ]
                faces = (*(old for old in kept if len(old.facets)), load)
        return replace(state, faces=faces, bodies=bodies)

    def _distributed_lines(
        self, block: Block, factor: float
    ) -> Iterator[tuple[int, list[str], str, list[float]]]:
        """Line, elements or surface, label and numbers; lines of single elements are joined."""
        joined: dict[tuple[Any, ...], tuple[int, dict[str, None], str, list[float]]] = {}
        for number, items in self.reading.lines(block):
            with self.reading.noted(block, number):
                label = items[1].upper() if len(items) > 1 else ""
                check_count(items, 2 + _NUMBERS.get(label, 4 if label == "TRVEC" else 1))
                rest = [factor * numbers(items[2:], 1)[0], *numbers(items[3:], 6)]
                # An element that is named twice is loaded twice.
                again = 0 if items[0].isdecimal() else number
                while items[0] in joined.get((again, label, *rest), (0, {}))[1]:
                    again += 1
                key = (again, label, *rest)
                known = joined.setdefault(key, (number, {}, label, rest))
                known[1][items[0]] = None
        for number, chosen, label, rest in joined.values():
            yield number, list(chosen), label, rest

    def _face_load(
        self, title: str, facets: IntArray, size: float, vector: Vector | None, *rest: Any
    ) -> FaceLoad:
        """Load on facets, which must be on the outside."""
        inside = np.count_nonzero(~are_among(facets, self.border))
        if inside or not len(facets):
            raise InputError(
                f"{inside or 'all'} of {len(facets)} faces of '{title}' are not on the outside of "
                f"the part: {TAKE_OUT}"
            )
        chosen = self.border[are_among(self.border, facets)]
        return FaceLoad(title, chosen, size * self.reading.pressure, vector, *rest)

    def _on_surface(self, name: str, label: str, rest: list[float], now: int) -> FaceLoad:
        """Load of a line of *DSLOAD."""
        facets = facets_of_surface(self.reading.model, name, self.border)
        if label == "P":
            return self._face_load(name, facets, rest[0], None, now, "DSLOAD")
        if label != "TRVEC" or not any(rest[1:4]):
            raise InputError(f"{shown(label)} is not followed, P and TRVEC are: {TAKE_OUT}")
        x, y, z = (np.asarray(rest[1:4]) / np.linalg.norm(rest[1:4])).tolist()
        return self._face_load(name, facets, rest[0], (x, y, z), now, "DSLOAD")

    def _on_body(
        self,
        names: list[str],
        label: str,
        rest: list[float],
        bodies: tuple[BodyLoad, ...],
        now: int,
        line: int,
    ) -> tuple[BodyLoad, ...]:
        """Add a load on the volume to those that act."""
        if label not in ("GRAV", "CENTRIF", *BODY):
            known = ", ".join((*_FACE, *BODY, "GRAV", "CENTRIF"))
            raise InputError(f"{shown(label)} is not followed; there are {known}: {TAKE_OUT}")
        cells = self.reading.cells(names)[1] if names[0] else np.arange(len(self.mesh.cells))
        given = _NUMBERS.get(label, 1)
        new = BodyLoad(label, cells, tuple(rest[:given]), now, line)
        kept = []
        for old in bodies:
            shared = np.isin(old.cells, cells)
            if old.step == now or old.label != label or not shared.any():
                kept.append(old)
                continue
            if old.numbers[1:] != new.numbers[1:]:
                raise InputError(
                    f"{label} of line {old.line} gets another direction or axis, which programs "
                    "take as one more load or in place of it: write OP=NEW and all loads"
                )
            if not shared.all():
                kept.append(old._replace(cells=old.cells[~shared]))
        return (*kept, new)

    def _warmed(self, block: Block, before: FloatArray | None, factor: float) -> FloatArray:
        """Temperatures of the nodes with those that a keyword gives; NaN where none is known."""
        result = np.full(len(self.mesh.points), np.nan) if before is None else before.copy()
        for number, items in self.reading.lines(block):
            with self.reading.noted(block, number):
                if len(items) < 2 or len([item for item in items if item]) != 2:
                    raise InputError(
                        f"expected nodes and one temperature; got {shown(', '.join(items))}: "
                        f"{TAKE_OUT}"
                    )
                result[self.reading.nodes(items[0])] = factor * numbers(items[1:2], 1)[0]
        ends = self.reading.split.ends  # middles of diagonals, of which the deck knows nothing
        result[len(result) - len(ends) :] = result[ends].mean(axis=1)
        return result
