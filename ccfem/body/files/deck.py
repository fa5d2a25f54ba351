"""Input decks of Abaqus and CalculiX: lines, keywords, scopes, and one mesh of all instances.

A deck is read in four steps: lines, those of other files (*INCLUDE, INPUT=) in their place;
keywords with their data; scopes, since a part, an instance and the assembly have nodes, elements,
sets and surfaces of their own; and one mesh of all instances, where they are placed. Read are
*PART, *INSTANCE, *NODE, *ELEMENT, *NSET, *ELSET and *SURFACE; what makes or moves nodes and
elements in other ways is refused, and everything else is kept as it stands, in `Deck.rest`.
"""

import re
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError, shown
from ccfem.base.whole import existing_file
from ccfem.body.files.cells import CELL_FACES, CORNERS, triangles_of

# From lines to keywords.


@dataclass(frozen=True)
class Block:
    """A keyword with its parameters and data lines, and the numbers of these lines in its file."""

    keyword: str
    parameters: dict[str, str]
    file: Path
    number: int
    lines: list[str] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)

    @property
    def where(self) -> str:
        """Place of the keyword for messages."""
        return f"{self.file}, line {self.number}"


def _lines(
    path: Path,
    folder: Path,
    above: tuple[Path, ...] = (),
    before: Callable[[Path], object] = lambda other: None,
) -> Iterator[tuple[str, Path, int]]:
    """Whole headings and data lines with file and number, those of other files included.

    As Abaqus and CalculiX do, files are looked for in the folder of the deck. `before` is called
    with each file before that is read.
    """
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    heading = ""
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        line, heading = heading + line, ""
        if not line.startswith("*"):
            yield line, path, number
            continue
        if line.endswith(","):
            heading = line
            continue
        keyword, parameters = _heading(line)
        if keyword != "INCLUDE":
            yield line, path, number
        if keyword == "INCLUDE" or (keyword in _READ and "INPUT" in parameters):
            name = parameters.get("INPUT", "").replace("\\", "/")
            where = f"{path}, line {number}"
            before(folder / name)
            other = existing_file(folder / name, f"{where}: the file of *{keyword}")
            if other in (path, *above) or not other.is_file():
                raise InputError(f"{where}: {other} includes itself, or is no file: take it out")
            yield from _lines(other, folder, (path, *above), before)


def check_included(deck: Path, check: Callable[[Path], object]) -> None:
    """Have each file that a deck includes checked, before it is read."""
    for _ in _lines(deck, deck.parent, before=check):
        pass


def _heading(line: str) -> tuple[str, dict[str, str]]:
    """Keyword and parameters of a heading; parameters without a value have an empty one.

    Blanks in names of parameters have no meaning, as in ``REF NODE``: they are left out.
    """
    keyword, *rest = line[1:].split(",")
    pairs = (item.partition("=") for item in rest)
    parameters = {
        "".join(name.upper().split()): value.strip().strip('"') for name, _, value in pairs
    }
    return " ".join(keyword.upper().split()), parameters


def _blocks(path: Path) -> Iterator[Block]:
    """Keywords of a deck with their data lines."""
    current: Block | None = None
    for line, file, number in _lines(path, path.parent):
        if not line.startswith("*"):
            if current is not None:
                current.lines.append(line)
                current.numbers.append(number)
            continue
        if current is not None:
            yield current
        current = Block(*_heading(line), file, number)
    if current is not None:
        yield current


# From keywords to scopes.


_READ = ("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE")
_REFUSED = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY", "SYSTEM")
"""Keywords that make or move nodes and elements in ways that are not followed."""
_KINDS = (
    (r"D?C3D4", "tetra", 4),
    (r"D?C3D10", "tetra10", 10),
    (r"D?C3D8|SC8", "hexahedron", 8),
    (r"D?C3D20", "hexahedron20", 20),
    (r"D?C3D6|SC6", "wedge", 6),
    (r"D?C3D15", "wedge15", 15),
    (r"D?C3D5", "pyramid", 5),
    (r"D?C3D13", "pyramid13", 13),
    (r"D?C3D27", "hexahedron27", 27),
    (r"(CPS|CPE|S|M3D|SFM3D|R3D|DS|STRI)3|S3R", "triangle", 3),
    (r"(CPS|CPE|M3D|SFM3D|DS|S)6|STRI65", "triangle6", 6),
    (r"(CPS|CPE|S|M3D|SFM3D|R3D|DS)4", "quad", 4),
    (r"(CPS|CPE|S|M3D|SFM3D|DS)8", "quad8", 8),
    (r"(S|M3D)9", "quad9", 9),
)
"""Element types by the start of their name (variants end in letters), and their nodes."""
NODES, ELEMENTS, FACES = "node set", "element set", "surface"
"""Kinds of named sets: a name may stand for one of each."""
_DIGITS = 16
"""Digits that no label has."""


@dataclass(frozen=True)
class Members:
    """What one line or keyword adds to a set.

    Attributes
    ----------
    kind : str
        Of the labels and names: `NODES` or `ELEMENTS`. A node set may take those of elements.
    labels : (k,) array
    ranges : tuple of range
    names : tuple of str
        Sets, and labels with their instance, as ``P-1.7``.
    instance : str
        Whose labels and names they are, in capitals; empty for those of the scope itself.
    face : str
        Of elements, in a surface: S1 to S6, or empty for the elements themselves.
    """

    kind: str
    labels: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    ranges: tuple[range, ...] = ()
    names: tuple[str, ...] = ()
    instance: str = ""
    face: str = ""


@dataclass
class Scope:
    """What a part, an instance or the assembly defines.

    Attributes
    ----------
    title : str
        Name of the part or the instance; empty for the assembly.
    part : str
        Of an instance, its part, in capitals.
    moves : list of (3,) and (7,) arrays
        Of an instance: translation; two points of an axis, and an angle in degrees.
    nodes : list of (labels, points)
    elements : list of (kind, rows)
        Label and nodes of each element.
    sets : dict of (kind, name in capitals) to list of Members
    titles : dict of name in capitals to name
    """

    title: str = ""
    part: str = ""
    moves: list[FloatArray] = field(default_factory=list)
    nodes: list[tuple[IntArray, FloatArray]] = field(default_factory=list)
    elements: list[tuple[str, IntArray]] = field(default_factory=list)
    sets: dict[tuple[str, str], list[Members]] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)

    def add(self, kind: str, name: str, *members: Members) -> None:
        """Add members to a set, which may be new."""
        if not name:
            raise ValueError("it has no name")
        self.titles.setdefault(name.upper(), name)
        self.sets.setdefault((kind, name.upper()), []).extend(members)

    def take(self, other: "Scope") -> None:
        """Put what another scope defines in front."""
        self.nodes[:0] = other.nodes
        self.elements[:0] = other.elements
        for key, members in other.sets.items():
            self.sets[key] = [*members, *self.sets.get(key, [])]
        self.titles = {**other.titles, **self.titles}


@dataclass
class Deck:
    """The scopes of a deck by their names in capitals, and the one that is open.

    Attributes
    ----------
    rest : list of (Block, Scope)
        Keywords that make no mesh and no set, with the scope that they stand in.
    bare : dict of str to int
        Elements of kinds without volume or area: lines by their type.
    """

    assembly: Scope = field(default_factory=Scope)
    parts: dict[str, Scope] = field(default_factory=dict)
    instances: dict[str, Scope] = field(default_factory=dict)
    rest: list[tuple[Block, Scope]] = field(default_factory=list)
    bare: dict[str, int] = field(default_factory=dict)
    scope: Scope = field(init=False)

    def __post_init__(self) -> None:
        self.scope = self.assembly

    def open(self, scopes: dict[str, Scope], scope: Scope) -> None:
        """Open a part or an instance."""
        if not scope.title or scope.title.upper() in scopes:
            raise ValueError(f"the name {shown(scope.title)} is missing or taken")
        scopes[scope.title.upper()] = self.scope = scope


def _read_block(deck: Deck, block: Block) -> None:
    """Add a keyword to the deck."""
    parameters, lines, scope = block.parameters, block.lines, deck.scope
    match block.keyword:
        case "PART":
            deck.open(deck.parts, Scope(parameters.get("NAME", "")))
        case "INSTANCE":
            if "PART" not in parameters:
                raise ValueError("it names no part: only instances of parts in the deck are read")
            new = Scope(parameters.get("NAME", ""), parameters["PART"].upper())
            new.moves = list(map(_move, lines))
            deck.open(deck.instances, new)
        case "END PART" | "END INSTANCE" | "ASSEMBLY":
            deck.scope = deck.assembly
        case "NODE":
            labels, points = _nodes(block)
            scope.nodes.append((labels, points))
            if "NSET" in parameters:
                scope.add(NODES, parameters["NSET"], Members(NODES, labels))
        case "ELEMENT":
            if not _read_elements(scope, block):
                of_type = parameters.get("TYPE", "").upper()
                deck.bare[of_type] = deck.bare.get(of_type, 0) + len(lines)
        case "NSET":
            members = [_members(NODES, block)]
            if "ELSET" in parameters:
                members = [Members(ELEMENTS, names=(parameters["ELSET"],))]
            scope.add(NODES, parameters.get("NSET", ""), *members)
        case "ELSET":
            scope.add(ELEMENTS, parameters.get("ELSET", ""), _members(ELEMENTS, block))
        case "SURFACE":
            kind = {"NODE": NODES, "ELEMENT": ELEMENTS}.get(
                parameters.get("TYPE", "ELEMENT").upper()
            )
            rows = [[item.strip() for item in f"{line},".split(",")] for line in lines]
            if kind is None or "COMBINE" in parameters:  # it stays, without facets
                rows, kind = [], NODES
            members = [listed(kind, row[:1], face=row[1].upper()) for row in rows]
            scope.add(FACES, parameters.get("NAME", ""), *members)
        case keyword if keyword in _REFUSED:
            raise ValueError("it is not followed; only *NODE and *ELEMENT are")
        case _:
            deck.rest.append((block, scope))


def _nodes(block: Block) -> tuple[IntArray, FloatArray]:
    """Labels (n,) and points (n, 3); coordinates that are left out are zero, normals not read."""
    if block.parameters.get("SYSTEM", "R").upper() != "R":
        raise ValueError("only rectangular coordinates are read")
    rows = [line.split(",") for line in block.lines]
    for line, row in zip(block.lines, rows, strict=True):
        if len(row) > 8:
            raise ValueError(f"{shown(line)} is more than a label, coordinates and a normal")
    points = np.array([numbers_of_line(row[1:4], 3) for row in rows]).reshape(-1, 3)
    return _labels(row[0] for row in rows), points


def numbers_of_line(items: list[str], count: int) -> list[float]:
    """Numbers of a line, at least so many: blank ones are zero, exponents may be Fortran's D."""
    values = [float(item.strip().upper().replace("D", "E") or 0.0) for item in items]
    return values + [0.0] * (count - len(values))


def _move(line: str) -> FloatArray:
    """Read a translation of an instance, or two points of an axis and an angle."""
    move = np.array(numbers_of_line(line.rstrip(", ").split(","), 3))
    if len(move) not in (3, 7) or not np.isfinite(move).all():
        raise ValueError(f"expected 3 or 7 finite numbers; got {shown(line)}")
    if len(move) == 7 and not 0.0 < np.linalg.norm(move[3:6] - move[:3]) < np.inf:
        raise ValueError(f"the axis of {shown(line)} has no length")
    return move


def _is_label(item: str) -> bool:
    return item.isascii() and item.isdecimal()


def _labels(items: Iterable[str]) -> IntArray:
    """Read labels: whole numbers from 1 on."""
    items = list(items)
    try:
        labels = np.array(list(map(int, items)), dtype=np.int64)
        if (labels > 0).all():
            return labels
    except (ValueError, OverflowError):
        pass
    short = (item for item in items if _is_label(item.strip()) and len(item.strip()) < _DIGITS)
    right = {item for item in short if int(item)}
    wrong = next(item.strip() for item in items if item not in right)
    raise ValueError(f"labels are whole numbers from 1 on; got {shown(wrong)}")


def _read_elements(scope: Scope, block: Block) -> bool:
    """Add the elements of a block; kinds without volume or area are left out, which is said."""
    name = block.parameters.get("TYPE", "").upper()
    known = [entry for entry in _KINDS if re.fullmatch(rf"(?:{entry[0]})[A-Z]*", name)]
    labels = np.zeros(0, dtype=np.int64)
    for _, kind, count in known[:1]:
        rows = np.zeros((1, 1), dtype=np.int64)  # of a kind that is refused, how many is no matter
        if count:
            numbers = _labels(
                [item for line in block.lines for item in line.rstrip(", ").split(",")]
            )
            if len(numbers) % (count + 1):
                raise ValueError(f"{len(numbers)} numbers do not make rows of {count + 1}")
            rows = numbers.reshape(-1, count + 1)
            labels = rows[:, 0]
        scope.elements.append((kind, rows))
    if "ELSET" in block.parameters:
        scope.add(ELEMENTS, block.parameters["ELSET"], Members(ELEMENTS, labels))
    return bool(known)


def _members(kind: str, block: Block) -> Members:
    """Members of a set by the lines of its keyword."""
    instance = block.parameters.get("INSTANCE", "").upper()
    rows = [[item.strip() for item in line.split(",") if item.strip()] for line in block.lines]
    if "GENERATE" not in block.parameters:
        return listed(kind, [item for row in rows for item in row], instance)
    ranges = []
    for row in rows:
        if len(row) not in (2, 3):
            raise ValueError(f"expected first, last and step; got {shown(', '.join(row))}")
        first, last, *step = _labels(row).tolist()
        ranges.append(range(first, last + 1, *step))
    return Members(kind, ranges=tuple(ranges), instance=instance)


def listed(kind: str, items: list[str], instance: str = "", face: str = "") -> Members:
    """Members of a set by labels and names."""
    names = tuple(item.strip('"') for item in items if not _is_label(item))
    return Members(kind, _labels(filter(_is_label, items)), (), names, instance, face)


# From scopes to one mesh.


@dataclass(frozen=True)
class _Rows:
    """Rows of nodes or elements in the model by their labels in a scope, ascending."""

    labels: IntArray
    rows: IntArray

    @classmethod
    def of(cls, labels: IntArray, first: int) -> "_Rows":
        """Rows that follow each other from `first` on."""
        order = np.argsort(labels, kind="stable")
        return cls(labels[order], first + order)

    def at(self, labels: IntArray) -> IntArray:
        """Row of each label, -1 for one that is not there."""
        place = np.searchsorted(self.labels, labels)
        known = np.append(self.labels, -1)[place] == labels
        return np.where(known, np.append(self.rows, -1)[place], -1)

    def within(self, labels: range) -> IntArray:
        """Rows of the labels in a range."""
        low, high = np.searchsorted(self.labels, [labels.start, labels.stop])
        wanted = (self.labels[low:high] - labels.start) % labels.step == 0
        return self.rows[low:high][wanted]


@dataclass(frozen=True)
class Model:
    """Nodes and elements of all scopes.

    Attributes
    ----------
    scopes : dict of name in capitals to Scope
        The assembly, under an empty name, and the instances.
    points : (n, 3) array
    blocks : list of (kind, (k, q) array)
        Elements by the rows of their nodes.
    rows : dict of (kind, name in capitals) to _Rows
        Of `NODES` and `ELEMENTS` in each scope.
    nodes : (e, q) array
        Rows of the nodes of all elements; -1 behind the last one.
    corners : (e,) array
        Number of corners of each element.
    flat : (e,) array
        Which elements are triangles or quadrangles.
    """

    scopes: dict[str, Scope]
    points: FloatArray
    blocks: list[tuple[str, IntArray]]
    rows: dict[tuple[str, str], _Rows]
    nodes: IntArray
    corners: IntArray
    flat: BoolArray


def read_deck(path: Path) -> tuple[Model, Deck]:
    """Read a deck: its nodes, elements and sets, and what else it says."""
    deck = Deck()
    for block in _blocks(path):
        try:
            _read_block(deck, block)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{block.where}: *{block.keyword} does not read ({error}): write the deck again"
            ) from None
    return _model(_scopes(deck, path)), deck


def has_steps(path: Path) -> bool:
    """Whether a deck holds an analysis: a *STEP in the file itself."""
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        return any(re.match(r"\s*\*\s*step\b", line, re.IGNORECASE) for line in lines)


def _scopes(deck: Deck, path: Path) -> dict[str, Scope]:
    """Scopes of the model: the assembly and the instances; without these a part is the model."""
    if not deck.instances:
        if len(deck.parts) > 1:
            raise InputError(
                f"the deck holds {len(deck.parts)} parts and no *INSTANCE of them: write the "
                "assembly, too, or the model flat"
            )
        for part in deck.parts.values():
            deck.assembly.take(part)
        return {"": deck.assembly}
    for instance in deck.instances.values():
        if instance.part not in deck.parts:
            raise InputError(
                f"instance {instance.title} is of part {shown(instance.part)}, which the deck does "
                "not have: write the part, too"
            )
        instance.take(deck.parts[instance.part])
    unused = deck.parts.keys() - {instance.part for instance in deck.instances.values()}
    if unused:
        names = ", ".join(sorted(deck.parts[part].title for part in unused))
        warnings.warn(f"{path}: parts without an instance are left out: {names}", stacklevel=2)
    return {"": deck.assembly, **deck.instances}


def _model(scopes: dict[str, Scope]) -> Model:
    """Model with the nodes and elements of all scopes."""
    if not any(len(labels) for scope in scopes.values() for labels, _ in scope.nodes):
        raise InputError("this is not an Abaqus deck: it has no *NODE with nodes")
    points, blocks = [np.zeros((0, 3))], list[tuple[str, IntArray]]()
    rows: dict[tuple[str, str], _Rows] = {}
    nodes_before = elements_before = 0
    for name, scope in scopes.items():
        labels, places = _distinct_nodes(scope)
        rows[NODES, name] = _Rows.of(labels, nodes_before)
        points.append(moved(places, scope.moves))
        for kind, elements in scope.elements:
            at = rows[NODES, name].at(elements[:, 1:])
            if (at < 0).any():
                label = elements[:, 1:][at < 0][0]
                raise InputError(f"an element names node {label}, which *NODE does not give")
            blocks.append((kind, at))
        labels = np.concatenate([[], *(e[:, 0] for _, e in scope.elements)]).astype(np.int64)
        rows[ELEMENTS, name] = _Rows.of(labels, elements_before)
        nodes_before += len(places)
        elements_before += len(labels)
    widest = max([at.shape[1] for _, at in blocks], default=0)
    padded = [
        np.pad(at, ((0, 0), (0, widest - at.shape[1])), constant_values=-1) for _, at in blocks
    ]
    nodes = np.concatenate([np.zeros((0, widest), dtype=np.int64), *padded])
    kinds = np.repeat(np.arange(len(blocks)), [len(at) for _, at in blocks])
    flat = np.array([kind.startswith(("triangle", "quad")) for kind, _ in blocks], dtype=bool)[
        kinds
    ]
    corners = np.array(
        [CORNERS.get(kind.rstrip("0123456789"), 0) for kind, _ in blocks], dtype=np.int64
    )
    for known in (rows[ELEMENTS, name] for name in scopes):
        again = np.flatnonzero(np.diff(known.labels) == 0)
        differ = (nodes[known.rows[again]] != nodes[known.rows[again + 1]]).any(axis=1)
        if differ.any():
            raise InputError(
                f"element {known.labels[again[differ][0]]} is given twice with different nodes: "
                "number the elements through"
            )
    return Model(scopes, np.concatenate(points), blocks, rows, nodes, corners[kinds], flat)


def _distinct_nodes(scope: Scope) -> tuple[IntArray, FloatArray]:
    """Labels (n,), ascending, and points (n, 3) of a scope."""
    labels = np.concatenate([[], *(labels for labels, _ in scope.nodes)]).astype(np.int64)
    points = np.concatenate([np.zeros((0, 3)), *(points for _, points in scope.nodes)])
    order = np.argsort(labels, kind="stable")
    labels, points = labels[order], points[order]
    same = np.diff(labels) == 0
    differ = same & (points[1:] != points[:-1]).any(axis=1)
    if differ.any():
        raise InputError(
            f"node {labels[1:][differ][0]} is given twice at different places: number the nodes "
            "through"
        )
    first = np.concatenate([[True], ~same])[: len(labels)]
    return labels[first], points[first]


def moved(points: FloatArray, moves: list[FloatArray]) -> FloatArray:
    """Points of an instance where it is placed: Abaqus translates first, then rotates."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused as infinite
        for move in moves:
            if len(move) == 3:
                points = points + move
                continue
            start, axis, angle = move[:3], move[3:6] - move[:3], move[6]
            turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis), degrees=True)
            points = start + turn.apply(points - start)
    return points


def chosen_rows(model: Model, scope: str, kind: str, members: list[Members]) -> IntArray:
    """Rows of the nodes or elements in a set, sets within it resolved."""
    chosen = [np.zeros(0, dtype=np.int64)]
    seen: set[tuple[str, str, str]] = set()
    waiting = [(scope, listed) for listed in members]
    while waiting:
        scope, listed = waiting.pop()
        if listed.instance and not scope and len(model.scopes) > 1:
            scope = listed.instance
            if scope not in model.scopes:
                raise InputError(
                    f"a set is of instance {shown(scope)}, which the deck does not have: write it, "
                    "too"
                )
        known = model.rows[listed.kind, scope]
        rows = [known.at(listed.labels)]
        rows += [known.within(labels) for labels in listed.ranges]
        for name in listed.names:
            inner, key = scope, name.upper()
            head, dot, tail = key.partition(".")
            if dot and not scope and head in model.scopes:
                inner, key = head, tail
            if _is_label(key):
                label = int(key) if len(key) < _DIGITS else 0
                rows.append(model.rows[listed.kind, inner].at(np.array([label])))
            elif (listed.kind, key) not in model.scopes[inner].sets:
                raise InputError(
                    f"a set or surface names the {listed.kind} {shown(name)}, which the deck does "
                    "not have: write it, too"
                )
            elif (inner, listed.kind, key) not in seen:
                seen.add((inner, listed.kind, key))
                waiting += [(inner, more) for more in model.scopes[inner].sets[listed.kind, key]]
        at = np.concatenate(rows)
        at = at[at >= 0]
        if listed.kind != kind:
            at = model.nodes[at].reshape(-1)
            at = at[at >= 0]
        chosen.append(at)
    return np.unique(np.concatenate(chosen))


def element_faces(model: Model, rows: IntArray, face: str) -> IntArray:
    """Facets (k, 3) of elements (rows): a face of solids, as "S1", or flat elements, "SPOS".

    Without the name of a face they are all faces and all flat elements; quadrangles are cut.
    """
    flat, corners = model.flat[rows], model.corners[rows]
    facets = [np.zeros((0, 3), dtype=np.int64)]
    for count in (3, 4) if face in ("", "SPOS", "SNEG") else ():
        facets.append(triangles_of(model.nodes[rows[flat & (corners == count)], :count]))
    for count, faces in CELL_FACES.items():
        nodes = model.nodes[rows[~flat & (corners == count)]]
        for number, of_face in enumerate(faces, 1):
            if len(nodes) and face in ("", f"S{number}"):
                facets.append(triangles_of(nodes[:, of_face]))
    return np.concatenate(facets)
