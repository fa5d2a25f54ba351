"""Abaqus and CalculiX input decks (``.inp``): nodes, tetrahedra and the sets that name patches.

Read are *NODE, *ELEMENT, *NSET, *ELSET and *SURFACE; everything else is ignored. Patches come
from surfaces (of element faces or of nodes), from sets of triangles (shells, membranes), and from
node sets: a boundary facet belongs to a node set when its three corners do. Sets whose name begins
with an underscore are the pre-processor's own and give no patch.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.files.cells import tetrahedra
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.patches import match_boundary

_KINDS = (
    (r"C3D4|DC3D4", "tetra", 4),
    (r"C3D10|DC3D10", "tetra10", 10),
    (r"(CPS|CPE|S|M3D|SFM3D|R3D|DS|STRI)3|S3R", "triangle", 3),
    (r"(CPS|CPE|M3D|SFM3D|DS)6|STRI65", "triangle6", 6),
    (r"C3D8|C3D20|C3D27", "hexahedron", 0),
    (r"C3D6|C3D15", "wedge", 0),
    (r"C3D5|C3D13", "pyramid", 0),
)
"""Element types by the start of their name (variants end in letters), and their nodes."""

_LARGEST = 2**53
"""Labels that a double holds."""
_FACES = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
"""Corner nodes of the faces S1 to S4."""


@dataclass(frozen=True)
class _Block:
    """A keyword with its parameters and data lines."""

    keyword: str
    parameters: dict[str, str]
    lines: list[str]
    where: int


@dataclass
class _Deck:
    """What has been read so far, by the labels of the deck."""

    nodes: list[FloatArray] = field(default_factory=list)
    elements: dict[str, list[IntArray]] = field(default_factory=dict)
    node_sets: dict[str, list[str | range]] = field(default_factory=dict)
    element_sets: dict[str, list[str | range]] = field(default_factory=dict)
    surfaces: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    titles: dict[str, str] = field(default_factory=dict)
    parts: int = 0


def read(path: Path) -> TetMesh:
    """Read an Abaqus or CalculiX input deck.

    Raises
    ------
    InputError
        When the deck has no tetrahedra, several parts, or data that does not read.
    """
    deck = _Deck()
    for block in _keyword_blocks(path):
        try:
            _read_block(deck, block)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{path}, line {block.where}: *{block.keyword} does not read ({error}): write "
                "the deck again"
            ) from None
    if deck.parts > 1:
        raise InputError(
            f"{path} holds {deck.parts} parts; one is expected: write the model flat, without "
            "parts and assemblies"
        )
    if not any(map(len, deck.nodes)):
        raise InputError(f"{path} is not an Abaqus deck: it has no *NODE with nodes")
    table = np.concatenate(deck.nodes)
    labels = table[:, 0].astype(np.int64)
    order = np.argsort(labels, kind="stable")
    if (np.diff(labels[order]) == 0).any():
        raise InputError(f"{path} gives a node twice: write the model flat, one number a node")
    labels = labels[order]
    blocks = []
    for kind, parts in deck.elements.items():
        rows = np.concatenate(parts)
        blocks.append((kind, _positions(rows[:, 1:], labels, path)))
    mesh = TetMesh(table[order, 1:], tetrahedra(blocks, path))
    return mesh.with_patches(_patches(deck, mesh, labels, path))


def _keyword_blocks(path: Path) -> Iterator[_Block]:
    """Keywords of a deck with their data lines; comments are dropped."""
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    current: _Block | None = None
    heading = ""
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if heading:
            line, heading = heading + line, ""
        if not line.startswith("*"):
            if current is not None:
                current.lines.append(line)
            continue
        if line.endswith(","):
            heading = line
            continue
        if current is not None:
            yield current
        keyword, *rest = line[1:].split(",")
        parameters = {}
        for item in rest:
            name, _, value = item.partition("=")
            parameters[name.strip().upper()] = value.strip().strip('"')
        current = _Block(" ".join(keyword.upper().split()), parameters, [], number)
    if current is not None:
        yield current


def _read_block(deck: _Deck, block: _Block) -> None:
    """Add a keyword to the deck."""
    parameters = block.parameters
    if block.keyword == "PART":
        deck.parts += 1
    elif block.keyword == "NODE":
        if parameters.get("SYSTEM", "R").upper() != "R":
            raise ValueError("only rectangular coordinates are read")
        rows = _number_rows(block.lines, 4)
        _check_labels(rows[:, :1])
        deck.nodes.append(rows)
        if "NSET" in parameters:
            nodes = [str(int(label)) for label in rows[:, 0]]
            deck.node_sets.setdefault(_key(deck, parameters["NSET"]), []).extend(nodes)
    elif block.keyword == "ELEMENT":
        _read_elements(deck, block)
    elif block.keyword in ("NSET", "ELSET"):
        sets = deck.node_sets if block.keyword == "NSET" else deck.element_sets
        members = _members(block.lines, "GENERATE" in parameters)
        sets.setdefault(_key(deck, parameters.get(block.keyword, "")), []).extend(members)
    elif block.keyword == "SURFACE":
        node_based = parameters.get("TYPE", "ELEMENT").upper() == "NODE"
        entries = deck.surfaces.setdefault(_key(deck, parameters.get("NAME", "")), [])
        for line in block.lines:
            name, _, face = line.partition(",")
            entries.append((name.strip(), "NODE" if node_based else face.strip(" ,").upper()))
    elif block.keyword == "INCLUDE":
        raise ValueError("*INCLUDE is not followed: put the deck into one file")


def _read_elements(deck: _Deck, block: _Block) -> None:
    """Add the elements of a block; kinds without volume or area are ignored."""
    name = block.parameters.get("TYPE", "").upper()
    known = [entry for entry in _KINDS if re.fullmatch(rf"(?:{entry[0]})[A-Z]*", name)]
    if not known:
        return
    _, kind, count = known[0]
    rows = np.zeros((1, 1), dtype=np.int64)
    if count:
        values = _number_rows(block.lines, count + 1)
        _check_labels(values)
        rows = values.astype(np.int64)
    deck.elements.setdefault(kind, []).append(rows)
    if "ELSET" in block.parameters and count:
        members = [str(label) for label in rows[:, 0]]
        deck.element_sets.setdefault(_key(deck, block.parameters["ELSET"]), []).extend(members)


def _number_rows(lines: list[str], columns: int) -> FloatArray:
    """Comma-separated numbers as rows; a row may continue on the next line."""
    joined = ",".join(line.rstrip(",") for line in lines)
    values = np.array(joined.split(",") if joined else [], dtype=np.float64)
    if len(values) % columns:
        raise ValueError(f"{len(values)} numbers do not make rows of {columns}")
    return values.reshape(-1, columns)


def _check_labels(values: FloatArray) -> None:
    """Raise on labels that are no whole numbers."""
    wrong = values[~((values == np.floor(values)) & (np.abs(values) < _LARGEST))]
    if len(wrong):
        raise ValueError(f"labels are whole numbers; got {wrong[0]:g}")


def _members(lines: list[str], generate: bool) -> list[str | range]:
    """Labels, set names, and ranges of labels in a set."""
    items = [item.strip() for line in lines for item in line.split(",") if item.strip()]
    if not generate:
        return list(items)
    members: list[str | range] = []
    for line in lines:
        first, last, *step = (int(item) for item in line.split(",") if item.strip())
        members.append(range(first, last + 1, step[0] if step else 1))
    return members


def _key(deck: _Deck, name: str) -> str:
    """Name of a set without its instance and without case; its own spelling is kept."""
    title = name.strip().strip('"').rpartition(".")[2]
    deck.titles.setdefault(title.upper(), title)
    return title.upper()


def _labels(
    members: list[str | range], sets: dict[str, list[str | range]], known: IntArray
) -> IntArray:
    """Those of the known labels that are members of a set, sets within it resolved."""
    chosen = np.zeros(len(known), dtype=bool)
    single: list[int] = []
    seen: set[str] = set()
    waiting = [members]
    while waiting:
        for member in waiting.pop():
            if isinstance(member, range):
                if len(member):
                    low, high = min(member[0], member[-1]), max(member[0], member[-1])
                    inside = (known >= max(low, -_LARGEST)) & (known <= min(high, _LARGEST))
                    step = min(abs(member.step), _LARGEST)
                    chosen |= inside & ((known - max(min(low, _LARGEST), -_LARGEST)) % step == 0)
                continue
            name = member.strip('"').rpartition(".")[2]
            if name.isascii() and name.isdecimal():
                if len(name) < 16:
                    single.append(int(name))
            elif name.upper() in sets and name.upper() not in seen:
                seen.add(name.upper())
                waiting.append(sets[name.upper()])
    return known[chosen | np.isin(known, np.array(single, dtype=np.int64))]


def _positions(wanted: IntArray, labels: IntArray, path: Path) -> IntArray:
    """Positions of node labels in the sorted `labels`."""
    place = np.minimum(np.searchsorted(labels, wanted), len(labels) - 1)
    unknown = labels[place] != wanted
    if unknown.any():
        raise InputError(
            f"{path}: an element names node {wanted[unknown][0]}, which *NODE does not give"
        )
    return place


def _patches(deck: _Deck, mesh: TetMesh, labels: IntArray, path: Path) -> dict[str, IntArray]:
    """Facets (k, 3) of every surface, set of triangles and node set that has some."""
    solids = np.concatenate([*deck.elements.get("tetra", []), *deck.elements.get("tetra10", [])])
    corners_of = {int(label): k for k, label in enumerate(solids[:, 0])}
    triangles = {
        int(row[0]): row[1:4]
        for kind in ("triangle", "triangle6")
        for rows in deck.elements.get(kind, [])
        for row in rows
    }
    flat_labels = np.array(sorted(triangles), dtype=np.int64)
    solid_labels = np.array(sorted(corners_of), dtype=np.int64)

    def of_nodes(members: list[str | range]) -> IntArray:
        inside = np.isin(labels, _labels(members, deck.node_sets, labels))
        return mesh.boundary[inside[mesh.boundary].all(axis=1)]

    def of_triangles(members: list[str | range]) -> IntArray:
        named = _labels(members, deck.element_sets, flat_labels)
        rows = [triangles[k] for k in named.tolist()]
        if not rows:
            return np.zeros((0, 3), dtype=np.int64)
        return match_boundary(mesh, _positions(np.array(rows), labels, path))

    def of_surface(entries: list[tuple[str, str]]) -> IntArray:
        facets = []
        for name, face in entries:
            if face == "NODE":
                facets.append(of_nodes([name]))
            elif re.fullmatch(r"S[1-4]", face):
                named = _labels([name], deck.element_sets, solid_labels)
                chosen = [corners_of[k] for k in named.tolist()]
                facets.append(mesh.corners[chosen][:, _FACES[int(face[1]) - 1]])
            else:
                facets.append(of_triangles([name]))
        return match_boundary(mesh, np.concatenate(facets)) if facets else np.zeros((0, 3), int)

    patches: dict[str, IntArray] = {}
    for sets, choose in ((deck.node_sets, of_nodes), (deck.element_sets, of_triangles)):
        for key, members in sets.items():
            patches[key] = choose(members) if not key.startswith("_") else np.zeros((0, 3), int)
    for key, entries in deck.surfaces.items():
        patches[key] = of_surface(entries)
    return {deck.titles[key]: facets for key, facets in patches.items() if len(facets)}
