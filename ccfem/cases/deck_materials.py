"""Materials of a deck: *MATERIAL, *ORIENTATION and *SOLID SECTION to the materials of its cells.

Decks have no units. Forces are taken in N and times in s; the unit of length is `scale` mm. What
follows from these is right for decks in mm, N, MPa and t/mm^3, and for those in m, N, Pa, kg/m^3.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import MASS_DENSITY
from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.tensor import rotate_stiffness
from ccfem.body.files.cells import SplitCells
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
    numbers_of_line,
)
from ccfem.fem.materials import Material, isotropic

TAKE_OUT = "take it out, or write the analysis as a part file on this mesh"
"""Cure of what cannot be taken over."""


@dataclass
class DeckReading:
    """A deck while its analysis is read.

    Attributes
    ----------
    scale : float
        Unit of length of the deck, mm.
    mistakes : Mistakes
        What cannot be taken over, with its line.
    remarks : list of str
        What was left out and need not be wrong, with its line.
    split : SplitCells
        The tetrahedra of its cells.
    element_of : (m,) int array
        Row of the element that each of them is of.
    """

    model: Model
    deck: Deck
    scale: float
    split: SplitCells
    mistakes: Mistakes = field(default_factory=Mistakes)
    remarks: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.element_of = np.flatnonzero(~self.model.flat)[self.split.parent]

    @property
    def pressure(self) -> float:
        """Unit of stress of the deck, MPa."""
        return self.scale**-2

    @contextmanager
    def noted(self, block: Block, number: int | None = None) -> Iterator[None]:
        """Note what goes wrong in the block, with its line, and go on behind it."""
        try:
            yield
        except ValueError as error:
            lines = error.mistakes if isinstance(error, InputError) else (str(error),)
            where = f"{block.file}, line {block.number if number is None else number}"
            self.mistakes.lines += [f"{where}: *{block.keyword}: {line}" for line in lines]

    def remark(self, block: Block, text: str) -> None:
        """Say that something is left out."""
        self.remarks.append(f"{block.where}: *{block.keyword} {text}")

    def lines(self, block: Block) -> Iterator[tuple[int, list[str]]]:
        """Split the data lines: the number and items of each."""
        for number, line in zip(block.numbers, block.lines, strict=True):
            yield number, [item.strip() for item in line.split(",")]

    def nodes(self, item: str) -> IntArray:
        """Nodes of a set or a label, at least one."""
        rows = chosen_rows(self.model, "", NODES, [listed(NODES, [item])])
        if not len(rows):
            raise InputError(f"the deck has no node {shown(item)}: {TAKE_OUT}")
        return rows

    def cells(
        self, items: Sequence[str], scopes: Sequence[str] = ("",)
    ) -> tuple[IntArray, IntArray]:
        """Elements of sets and labels that have a volume, at least one: rows and cells."""
        members = [listed(ELEMENTS, list(items))]
        rows = [chosen_rows(self.model, scope, ELEMENTS, members) for scope in scopes]
        both = np.unique(np.concatenate(rows))
        both = both[~self.model.flat[both]]
        if not len(both):
            raise InputError(f"the deck has no solid in {shown(', '.join(items))}: {TAKE_OUT}")
        return both, np.flatnonzero(np.isin(self.element_of, both))

    def scopes_of(self, scope: Scope) -> list[str]:
        """Names in the model of a scope of the deck: of a part, all its instances."""
        for key, instance in self.deck.instances.items():
            if instance is scope:
                return [key]
        for key, part in self.deck.parts.items():
            if part is scope and self.deck.instances:
                return [name for name, at in self.deck.instances.items() if at.part == key]
        return [""]


def numbers(items: Sequence[str], count: int) -> list[float]:
    """So many finite numbers of a line; blank ones and those that are left out are zero."""
    try:
        values = numbers_of_line(list(items[:count]), count)
        if np.isfinite(values).all():
            return values
    except ValueError:
        pass
    raise InputError(f"expected finite numbers; got {shown(', '.join(items))}: correct them")


def check_count(items: Sequence[str], most: int) -> None:
    """Refuse a line with more items than are followed."""
    if any(items[most:]):
        raise InputError(
            f"a line has at most {most} items here; got {shown(', '.join(items))}: {TAKE_OUT}"
        )


def check_parameters(block: Block, *known: str) -> None:
    """Refuse parameters of a keyword that are not followed."""
    unknown = sorted(set(block.parameters) - {name.replace(" ", "") for name in known})
    if unknown:
        raise InputError(f"{', '.join(unknown)} is not followed: {TAKE_OUT}")


# Constants of materials.


_ELASTIC = {
    "ISOTROPIC": 2,
    "ISO": 2,
    "ENGINEERING CONSTANTS": 9,
    "ORTHOTROPIC": 9,
    "ORTHO": 9,
    "ANISOTROPIC": 21,
    "ANISO": 21,
}
"""Constants of each type of *ELASTIC."""
_EXPANSION = {"ISO": 1, "ISOTROPIC": 1, "ORTHO": 3, "ORTHOTROPIC": 3}
_VOIGT = (0, 1, 2, 5, 4, 3)
"""Places in a Voigt vector here of 11, 22, 33, 12, 13 and 23."""
_A_LINE = 8
"""Numbers on a line of a deck."""
_GRAM = 1e9
"""Grams per cm^3 in a tonne per mm^3."""


def _constants(block: Block, count: int) -> list[float]:
    """Constants of a material, which must not depend on temperature or anything else."""
    height = -(-count // _A_LINE)
    rows = [line.split(",") for line in block.lines]
    if not rows or len(rows) % height:
        raise InputError(f"expected {count} constants; got {len(rows)} lines: write them again")
    sets = set()
    for first in range(0, len(rows), height):
        items: list[str] = []
        for row in rows[first : first + height]:
            items += (row + [""] * _A_LINE)[:_A_LINE]
        sets.add(tuple(numbers([item.strip() for item in items], count)))
    if len(sets) > 1:
        raise InputError(
            f"constants that depend on temperature are not followed; got {len(sets)} sets: give one"
        )
    return list(sets.pop())


def _stiffness(kind: str, constants: Sequence[float]) -> FloatArray:
    """Stiffness (6, 6) of the constants of *ELASTIC."""
    if kind.startswith("ISO"):
        return isotropic(constants[0], constants[1]).stiffness
    if kind == "ENGINEERING CONSTANTS":
        e1, e2, e3, nu12, nu13, nu23, g12, g13, g23 = constants
        if not min(e1, e2, e3, g12, g13, g23) > 0.0:
            raise InputError(f"moduli must be above 0; got {constants}: correct them")
        compliance = np.diag([1 / e1, 1 / e2, 1 / e3, 1 / g23, 1 / g13, 1 / g12])
        compliance[0, 1] = compliance[1, 0] = -nu12 / e1
        compliance[0, 2] = compliance[2, 0] = -nu13 / e1
        compliance[1, 2] = compliance[2, 1] = -nu23 / e2
        if np.linalg.eigvalsh(compliance).min() <= 0.0:
            raise InputError(f"no material has these constants; got {constants}: correct them")
        stiffness = np.linalg.inv(compliance)
        return np.asarray(0.5 * (stiffness + stiffness.T))
    stiffness, values = np.zeros((6, 6)), iter(constants)
    for column, j in enumerate(_VOIGT):
        # Of the orthotropic ones only the diagonal stands below the normal stresses.
        rows = range(column + 1) if len(constants) == 21 or column < 3 else [column]
        for i in (_VOIGT[row] for row in rows):
            stiffness[i, j] = stiffness[j, i] = next(values)
    return stiffness


@dataclass(frozen=True)
class _Constants:
    """What the keywords below a *MATERIAL say."""

    name: str
    stiffness: FloatArray | None = None
    mass_density: float | None = None
    expansion: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class _Axes:
    """A *ORIENTATION: its points (2, 3), a turn about a local axis, and whether it is round."""

    points: FloatArray
    turn: FloatArray
    cylindrical: bool

    def at(self, centres: FloatArray, moves: list[FloatArray]) -> FloatArray:
        """Axes (k, 3, 3) as columns at places (k, 3) in an instance that is moved."""
        frame = moved(np.concatenate([np.zeros((1, 3)), np.eye(3)]), moves)
        turned = (frame[1:] - frame[0]).T
        if self.cylindrical:
            start, end = moved(self.points, moves)
            third = np.tile((end - start) / np.linalg.norm(end - start), (len(centres), 1))
            first = centres - start
            first = first - np.einsum("ki,ki->k", first, third)[:, None] * third
            size = np.linalg.norm(first, axis=1)
            if not (size > 0.0).all():
                raise InputError("a cell lies on the axis of the cylinder: move the axis")
            first /= size[:, None]
        else:
            first = self.points[0] / np.linalg.norm(self.points[0])
            third = np.cross(self.points[0], self.points[1])
            third = np.tile(turned @ third / np.linalg.norm(third), (len(centres), 1))
            first = np.tile(turned @ first, (len(centres), 1))
        axes = np.stack([first, np.cross(third, first), third], axis=2)
        return np.asarray(axes @ self.turn)


def _orientation(block: Block) -> _Axes:
    """Read the axes of a *ORIENTATION."""
    check_parameters(block, "NAME", "SYSTEM", "DEFINITION")
    system = block.parameters.get("SYSTEM", "RECTANGULAR").upper()
    definition = block.parameters.get("DEFINITION", "COORDINATES").upper()
    if system not in ("RECTANGULAR", "CYLINDRICAL") or definition != "COORDINATES":
        raise InputError(f"SYSTEM={system}, DEFINITION={definition} is not followed: {TAKE_OUT}")
    rows = [line.split(",") for line in block.lines[:2]]
    if not rows:
        raise InputError("it has no points: give two")
    a, b, origin = np.reshape(numbers(rows[0], 9), (3, 3))
    axis, angle = numbers([*rows[1], "0"] if rows[1:] else ["1", "0"], 2)
    if axis not in (1.0, 2.0, 3.0):
        raise InputError(f"the axis of a turn must be 1, 2 or 3; got {axis:g}: name one")
    turn = Rotation.from_rotvec(angle * np.eye(3)[int(axis) - 1], degrees=True).as_matrix()
    cylindrical = system == "CYLINDRICAL"
    points = np.stack([a, b]) if cylindrical else np.stack([a, b]) - origin
    across = points[1] - points[0] if cylindrical else np.cross(*points)
    if not np.linalg.norm(across) > 0.0:
        raise InputError(f"its points show no axes; got {shown(block.lines[0])}: give others")
    return _Axes(points, turn, cylindrical)


# Which cells have which material.


@dataclass(frozen=True)
class CellMaterials:
    """Materials of the cells of a deck."""

    materials: tuple[Material, ...]  # that of the most cells first
    number: IntArray  # (m,): material of each cell
    axes: FloatArray | None  # (m, 3, 3): axes of the material of each cell, where they matter

    def with_expansion(self) -> "CellMaterials":
        """Materials of which those without expansion have none by heat, as in a deck."""
        return replace(
            self,
            materials=tuple(
                replace(one, expansion=one.expansion or (0.0, 0.0, 0.0)) for one in self.materials
            ),
        )


class DeckMaterials:
    """Materials, orientations and sections, as their keywords come by."""

    KEYWORDS = ("MATERIAL", "ELASTIC", "DENSITY", "EXPANSION", "ORIENTATION", "SOLID SECTION")

    def __init__(self, reading: DeckReading) -> None:
        self._reading = reading
        self._constants: dict[str, _Constants] = {}
        self._current = ""
        self._axes: dict[tuple[int, str], _Axes] = {}
        self._sections: list[tuple[Block, Scope]] = []

    def take(self, block: Block, scope: Scope) -> None:
        """Take a keyword of `KEYWORDS`; what is wrong with it is noted."""
        with self._reading.noted(block):
            match block.keyword:
                case "MATERIAL":
                    name = block.parameters.get("NAME", "")
                    self._current = name.upper()
                    self._constants[self._current] = _Constants(name)
                case "ORIENTATION":
                    key = (id(scope), block.parameters.get("NAME", "").upper())
                    self._axes[key] = _orientation(block)
                case "SOLID SECTION":
                    check_parameters(block, "ELSET", "MATERIAL", "ORIENTATION", "CONTROLS")
                    self._sections.append((block, scope))
                case _:
                    self._constant(block)

    def _constant(self, block: Block) -> None:
        """Add a constant to the material that is open."""
        if self._current not in self._constants:
            raise InputError("it stands below no *MATERIAL: name the material above it")
        before, reading = self._constants[self._current], self._reading
        kind = block.parameters.get("TYPE", "ISO").upper()
        if block.keyword == "ELASTIC":
            check_parameters(block, "TYPE")
            if kind not in _ELASTIC:
                raise InputError(f"TYPE={kind} is not followed: {TAKE_OUT}")
            constants = _constants(block, _ELASTIC[kind])
            moduli = slice(1) if kind.startswith("ISO") else slice(None)
            ratios = {3, 4, 5} if kind == "ENGINEERING CONSTANTS" else set()
            chosen = set(range(len(constants))[moduli]) - ratios
            scaled = [x * reading.pressure if k in chosen else x for k, x in enumerate(constants)]
            now = replace(before, stiffness=_stiffness(kind, scaled))
        elif block.keyword == "DENSITY":
            check_parameters(block)
            (density,) = _constants(block, 1)
            now = replace(before, mass_density=density * _GRAM * reading.scale**-4)
        else:
            check_parameters(block, "TYPE", "ZERO")
            if kind not in _EXPANSION:
                raise InputError(f"TYPE={kind} is not followed: {TAKE_OUT}")
            along = _constants(block, _EXPANSION[kind])
            x, y, z = along * 3 if len(along) == 1 else along
            now = replace(before, expansion=(x, y, z))
        self._constants[self._current] = now

    @property
    def expand(self) -> bool:
        """Whether some material has *EXPANSION."""
        return any(one.expansion is not None for one in self._constants.values())

    def of_cells(self, centres: FloatArray) -> CellMaterials | None:
        """Materials of the cells, whose centres are in the unit of the deck; None after mistakes.

        Every cell needs a section, and every section a material with *ELASTIC.
        """
        number = np.full(len(centres), -1)
        axes = np.tile(np.eye(3), (len(centres), 1, 1))
        made: dict[str, int] = {}
        materials: list[Material] = []
        turned = False
        for block, scope in self._sections:
            with self._reading.noted(block):
                key = block.parameters.get("MATERIAL", "").upper()
                if key not in made:
                    materials.append(self._material(key))
                    made[key] = len(materials) - 1
                material = materials[made[key]]
                for name in self._reading.scopes_of(scope):
                    elset = block.parameters.get("ELSET", "")
                    _, cells = self._reading.cells([elset], [name])
                    if (number[cells] >= 0).any():
                        raise InputError(
                            f"{np.count_nonzero(number[cells] >= 0)} of its tetrahedra have a "
                            "section already: give each one"
                        )
                    number[cells] = made[key]
                    if "ORIENTATION" in block.parameters:
                        moves = self._reading.model.scopes[name].moves
                        axes[cells] = self._oriented(block, scope).at(centres[cells], moves)
                        turned |= _has_directions(material)
        if self._reading.mistakes.lines:
            return None
        if (number < 0).any():
            self._reading.mistakes.lines.append(
                f"{np.count_nonzero(number < 0)} of {len(number)} tetrahedra have no *SOLID "
                "SECTION with a material: give them one"
            )
            return None
        count = np.bincount(number, minlength=len(materials))
        order = np.argsort(-count, kind="stable")
        order = order[count[order] > 0]
        rank = np.full(len(materials), -1)
        rank[order] = np.arange(len(order))
        return CellMaterials(
            tuple(materials[k] for k in order), rank[number], axes if turned else None
        )

    def _material(self, key: str) -> Material:
        """Material by its name in capitals."""
        if key not in self._constants:
            known = ", ".join(one.name for one in self._constants.values()) or "none"
            raise InputError(f"the deck has no material {shown(key)}; there are: {known}")
        one = self._constants[key]
        if one.stiffness is None:
            raise InputError(f"material {shown(one.name)} has no *ELASTIC: give it one")
        density = one.mass_density
        if (
            density is not None
            and not MASS_DENSITY.possible[0] <= density <= MASS_DENSITY.possible[1]
        ):
            self._reading.remarks.append(
                f"the density of material {shown(one.name)} is left out: it would be {density:g} "
                "g/cm^3, in units of mm, N, s and t, or of scale in place of mm"
            )
            density = None
        name = one.name if one.name.isprintable() else "material"
        return Material(
            name, one.stiffness, source="the deck", mass_density=density, expansion=one.expansion
        )

    def _oriented(self, block: Block, scope: Scope) -> _Axes:
        """Axes that a section names, of its own scope or of the model."""
        key = block.parameters["ORIENTATION"].upper()
        for owner in (scope, self._reading.deck.assembly):
            if (id(owner), key) in self._axes:
                return self._axes[id(owner), key]
        raise InputError(f"the deck has no *ORIENTATION {shown(key)}: write it, too")


def _has_directions(material: Material) -> bool:
    """Whether a material differs by direction."""
    turn = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()
    alike = np.allclose(rotate_stiffness(material.stiffness, turn), material.stiffness, rtol=1e-9)
    return not alike or len(set(material.expansion or ())) > 1
