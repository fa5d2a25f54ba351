"""Stress in files of results that CalculiX writes (``.frd``)."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError, shown
from ccfem.fem.stress_files.stress_arrays import StressData, component_order

_SOLIDS = {1: (8, 8), 2: (6, 6), 3: (4, 4), 4: (8, 20), 5: (6, 15), 6: (4, 10)}
"""Corners and nodes of the solids by element type (CalculiX 2.20 user's manual, section 11)."""
_STARTS = (13, 25, 37, 49, 61, 73)
"""Columns where the values of a node begin, twelve wide each."""


@dataclass(frozen=True)
class _Result:
    """Stress of one increment or mode, as lines, with its step and its time or frequency."""

    step: int
    value: float
    is_mode: bool
    lines: list[str]

    @classmethod
    def of(cls, heading: list[str], lines: list[str]) -> "_Result":
        """Take step, value and kind of a result from the lines 1PSTEP and 100C above it."""
        step, value, kind = 1, 0.0, 0
        for line in heading:
            if line.split()[:1] == ["1PSTEP"]:
                step = int(line.split()[-1])
            elif line.lstrip().startswith("100C"):
                value, kind = float(line[12:24].strip() or 0.0), int(line[56:58].strip() or 0)
        # Of a buckling step the first result is the stress before, at the value 0.
        return cls(step, value, kind == _FREQUENCY or (kind == _BUCKLING and value != 0.0), lines)

    def __str__(self) -> str:
        kind = "mode" if self.is_mode else "time"
        return f"step {self.step} ({kind} {self.value:.6g})"


_FREQUENCY, _BUCKLING = 2, 4
"""Kinds of analysis in the line 100C whose results may be modes."""
_LISTED = 8
"""Results that a message lists."""


def frd_stress(path: Path, step: int | None = None) -> StressData:
    """Stress in a file that CalculiX wrote with ``*NODE FILE`` and ``*EL FILE``.

    Parameters
    ----------
    step : int, optional
        Its last increment is read; needed where several steps have stress.

    Raises
    ------
    InputError
        When the file has no solids or no stress of that step, or other elements besides, or is cut
        off.
    """
    try:
        lines = path.read_text(encoding="ascii", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"expected a result file of CalculiX at {path}: {error}") from None
    points: dict[int, list[float]] = {}
    cells: list[list[int]] = []
    results: list[_Result] = []
    for block, heading, body in _result_blocks(lines, path):
        with _as_written(block, path):
            if block == "2C":
                points = _node_rows(body, 3)
            elif block == "3C":
                cells = _cells(body, path)
            elif block == "STRESS":
                results.append(_Result.of(heading, body))
    if not points or not cells:
        raise InputError(f"{path} has no mesh of solids: give the .frd file of a ccx run")
    result = _of_step(results, step, path)
    with _as_written("STRESS", path):
        names = [line.split()[1] for line in result.lines if line.startswith(" -5")]
        stress = _node_rows([line for line in result.lines if line.startswith(" -1")], 6)
    order = component_order(names[:6], f"{path}: the block STRESS")
    data = _mapped(points, cells, stress, order, path)
    chosen = f"of {path.name} the stress of {result} is taken" if len(results) > 1 else ""
    return replace(data, chosen=chosen, usual=("MPa", "its nodes are in mm"))


@contextmanager
def _as_written(block: str, path: Path) -> Iterator[None]:
    """Turn what goes wrong with the columns of a block into one line."""
    try:
        yield
    except (ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: the block {block} is not as CalculiX writes it in ASCII ({error}): write "
            "the file with ccx and its default output"
        ) from None


def _of_step(results: list[_Result], step: int | None, path: Path) -> _Result:
    """Last result of a step that is no mode; of the only one where no step is given."""
    listed = list(dict.fromkeys(map(str, results)))
    held = ", ".join(listed[:_LISTED]) + (", ..." if len(listed) > _LISTED else "")
    last = {result.step: result for result in results if not result.is_mode}
    if not results:
        raise InputError(f"{path} has no stress: ask ccx for it with *EL FILE and S")
    if not last:
        raise InputError(
            f"{path} has the stress of modes only, which has no size: {held}: give results of loads"
        )
    if step is None and len(last) > 1:
        raise InputError(
            f"{path} has the stress of several steps: {held}: choose a step with --stress-step"
        )
    if step is not None and step not in last:
        raise InputError(
            f"{path} has no stress of loads in step {step}; it has that of {held}: choose another "
            "step with --stress-step"
        )
    return last[next(iter(last)) if step is None else step]


def _result_blocks(lines: list[str], path: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    """Nodes (2C), elements (3C), and results by their name, with the lines before and in them."""
    name = ""
    heading: list[str] = []
    body: list[str] = []
    for line in lines:
        key = line.strip()
        if key.startswith(("2C", "3C")):
            name, body = key[:2], []
        elif line.startswith(" -4"):
            name, body = key.split()[1] if len(key.split()) > 1 else "", []
        elif line.startswith(" -3") and name:
            yield name, heading, body
            name, heading = "", []
        elif name:
            body.append(line)
        else:
            heading.append(line)
    if name:
        raise InputError(f"{path} is cut off in its block {name}: copy it again, or run ccx again")


def _node_rows(lines: list[str], count: int) -> dict[int, list[float]]:
    """First `count` values of each node: columns of twelve after the number of the node."""
    rows = {}
    for line in lines:
        rows[int(line[3:13])] = values = [float(line[k : k + 12]) for k in _STARTS[:count]]
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{shown(line.strip())} is not finite")
    return rows


def _cells(body: list[str], path: Path) -> list[list[int]]:
    """Corner nodes of each element."""
    cells: list[list[int]] = []
    wanted: list[tuple[int, int, int]] = []
    for line in body:
        if line.startswith(" -1"):
            kind = int(line[13:18])
            if kind not in _SOLIDS:
                raise InputError(
                    f"{path} has elements of type {kind}; expected solids only: types "
                    f"{', '.join(map(str, _SOLIDS))}"
                )
            wanted.append((int(line[3:13]), *_SOLIDS[kind]))
            cells.append([])
        elif line.startswith(" -2"):
            cells[-1] += [int(line[k : k + 10]) for k in range(3, len(line.rstrip()), 10)]
    for nodes, (number, _, count) in zip(cells, wanted, strict=True):
        if len(nodes) != count:
            raise ValueError(f"element {number} has {len(nodes)} nodes in place of {count}")
    return [nodes[:corners] for nodes, (_, corners, _) in zip(cells, wanted, strict=True)]


def _mapped(
    points: dict[int, list[float]],
    cells: list[list[int]],
    stress: dict[int, list[float]],
    order: list[int],
    path: Path,
) -> StressData:
    """Stress with the nodes numbered from 0 in the order of the file."""
    missing = sorted(set(points) - set(stress))
    if missing:
        raise InputError(
            f"{path}: {len(missing)} nodes have no stress, the first is {missing[0]}: write the "
            "stress of all elements"
        )
    place = {number: k for k, number in enumerate(points)}
    unknown = {node for nodes in cells for node in nodes} - set(place)
    if unknown:
        raise InputError(
            f"{path}: an element names node {min(unknown)}, which the block 2C does not have: copy "
            "the file again, or run ccx again"
        )
    rows = [[place[node] for node in nodes] for nodes in cells]
    counts = sorted({len(nodes) for nodes in rows})
    return StressData(
        np.array(list(points.values())),
        tuple(np.array([nodes for nodes in rows if len(nodes) == count]) for count in counts),
        np.array([stress[number] for number in points])[:, order],
        None,
        nodes=np.array(list(points)),
    )
