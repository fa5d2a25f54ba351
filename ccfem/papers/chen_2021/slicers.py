"""Paths of a common slicer, PrusaSlicer, on the authors' Loop: the baseline that knows no stress.

    CCFEM_CHEN2021=folder python -m ccfem.papers.chen_2021.slicers

prints the alignment with the stress at full density beside the figures stated for it. The section
of the middle layer is extruded by one layer height, sliced without perimeters, and the fill read
back from the G-code: all of it, with the pieces that are too short for a cutter. It lies in that
section; on other layers it may stand out where their facets at a hole differ.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.body.files.surface import write_stl
from ccfem.fem.elasticity import solve
from ccfem.judging.evaluation import evaluate
from ccfem.papers.chen_2021.loop import authors_loop
from ccfem.paths.planning.equal_fibre import TOLERANCE, length_per_layer
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

PROGRAM = "prusa-slicer"

PATTERNS = {
    "PrusaSlicer concentric": ("concentric", 0.0, 0.0),
    "PrusaSlicer rectilinear 45": ("rectilinear", 45.0, 90.0),
    "PrusaSlicer rectilinear 90": ("rectilinear", 90.0, 0.0),
}
"""Fill pattern, its angle in degrees in the even layers, and what the odd ones add to it.

90 degrees is along the load of the Loop, in every layer: PrusaSlicer's "aligned rectilinear".
"""

STATED = {
    "PrusaSlicer concentric": (0.207, 0.343, 0.459, 0.323, 0.536, 0.685, 37.6, 0.516),
    "PrusaSlicer rectilinear 45": (0.122, 0.202, 0.285, 0.157, 0.240, 0.319, 44.7, 0.303),
    "PrusaSlicer rectilinear 90": (0.276, 0.443, 0.542, 0.296, 0.477, 0.576, 30.9, 0.593),
}
"""Alignment at full density as an independent evaluation gave it, in the order of `_INDICES`."""

_INDICES = (
    *("aligned_10", "aligned_20", "aligned_30"),
    *("aligned_stress_10", "aligned_stress_20", "aligned_stress_30"),
    *("angle_mean", "efficiency"),
)

_HEIGHT = 0.2
"""Height of the layer that is sliced, mm."""
_WIDTH = 1.043
"""Extrusion width, mm, that spaces lines by 1 mm at full density: W + h (1 - pi / 4)."""
_CENTRE = (100.0, 100.0)
"""Where the middle of the section's bounding box is printed, mm."""
_ROUNDS = 10
"""Densities tried for a wanted length."""
_SECONDS = 120.0
"""After this long the slicer is taken to hang."""

_MODES = {
    "G90": ([0, 1, 2], True),
    "G91": ([0, 1, 2], False),
    "M82": ([3], True),
    "M83": ([3], False),
}
"""Axes (of X, Y, Z, E) that each command turns to absolute or relative."""

_WORD = re.compile(r"([A-Z])([-+]?(?:\d+\.?\d*|\.\d+))")


def slicer_found() -> bool:
    """Whether PrusaSlicer is on PATH."""
    return shutil.which(PROGRAM) is not None


def slicer_paths(
    layers: Sequence[Layer], pattern: str, angle: float, density: float, turn: float = 0.0
) -> Toolpaths:
    """Fill of the middle layer's section as PrusaSlicer prints it, repeated on every layer.

    Parameters
    ----------
    layers : sequence of Layer
        Flat layers of one frame and, but for the mesh's roughness, one section.
    pattern : str
        Fill pattern, as PrusaSlicer calls it.
    angle : float, degrees
        Fill angle.
    density : float in (0, 1]
        Fill density; 1 spaces lines by 1 mm.
    turn : float, degrees, default 0
        Added to the angle in every other layer, from the second on.

    Raises
    ------
    InputError
        When PrusaSlicer is not on PATH, refuses the section or these settings, or writes what is
        no plain G-code of one layer.
    """
    section = layers[len(layers) // 2]
    filled = {
        direction: _fill(section, pattern, direction, density)
        for direction in dict.fromkeys((angle, angle + turn))
    }
    return Toolpaths.concatenate(
        Toolpaths.from_plane(filled[angle + (turn if k % 2 else 0.0)], layer)
        for k, layer in enumerate(layers)
    )


def slicer_paths_to_length(
    layers: Sequence[Layer], pattern: str, angle: float, wanted: float, turn: float = 0.0
) -> Toolpaths:
    """As `slicer_paths`, at the density that lays at most `wanted` mm per layer, and nearly that.

    False position on the density, until within 1 % below `wanted`; of the densities tried, the one
    that lays most without laying too much. The length of concentric fill jumps where a ring appears
    inside the others, at first in many short pieces.
    """
    low, low_length, high, high_length = 0.0, 0.0, np.inf, np.inf
    best, density = Toolpaths.empty(), 0.5
    for _ in range(_ROUNDS):
        paths = slicer_paths(layers, pattern, angle, density, turn)
        length = length_per_layer(paths, layers)
        if length <= wanted:
            low, low_length, best = density, length, paths
        else:
            high, high_length = density, length
        if low_length >= (1.0 - TOLERANCE) * wanted or low == 1.0:
            break
        if np.isinf(high):
            density = min(1.0, 1.05 * density * wanted / max(length, 1e-9))
        else:
            share = (0.995 * wanted - low_length) / (high_length - low_length)
            density = low + float(np.clip(share, 0.1, 0.9)) * (high - low)
    return best


def _fill(layer: Layer, pattern: str, angle: float, density: float) -> list[FloatArray]:
    """Lines (k, 2), mm, of the fill in the plane of the layer."""
    program = shutil.which(PROGRAM)
    if program is None:
        raise InputError(
            f"expected the program '{PROGRAM}' on PATH; found none: install PrusaSlicer "
            f"(Debian: apt-get install {PROGRAM})"
        )
    options = {
        "center": "{:g},{:g}".format(*_CENTRE),
        "layer-height": f"{_HEIGHT:g}",
        "first-layer-height": f"{_HEIGHT:g}",
        "nozzle-diameter": "0.8",
        "extrusion-width": f"{_WIDTH:g}",
        "first-layer-extrusion-width": f"{_WIDTH:g}",
        "perimeters": "0",
        "top-solid-layers": "0",
        "bottom-solid-layers": "0",
        "skirts": "0",
        "brim-width": "0",
        "fill-pattern": pattern,
        "fill-angle": f"{angle:g}",
        "fill-density": f"{100.0 * density:.4f}%",
    }
    with tempfile.TemporaryDirectory() as folder:
        surface, printed = Path(folder) / "section.stl", Path(folder) / "section.gcode"
        _write_slab(surface, layer)
        command = [program, "--export-gcode", "--dont-arrange"]
        command += [word for name, value in options.items() for word in (f"--{name}", value)]
        command += ["-o", str(printed), str(surface)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, timeout=_SECONDS
            )
        except subprocess.TimeoutExpired:
            raise InputError(
                f"{PROGRAM} gave nothing in {_SECONDS:g} s: run it by hand on the section"
            ) from None
        if done.returncode != 0 or not printed.is_file():
            message = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()[-1]
            raise InputError(
                f"{PROGRAM} refused {pattern} at {angle:g} degrees, {density:.4g}: it said "
                f"'{message}': correct the pattern, the angle or the density"
            )
        lines = extrusion_lines(printed.read_text(encoding="utf-8"), f"G-code of {PROGRAM}")
    middle = 0.5 * (layer.plane.points.min(axis=0) + layer.plane.points.max(axis=0))
    return [line - np.array(_CENTRE) + middle for line in lines]


def _write_slab(path: Path, layer: Layer) -> None:
    """Write the section of a flat layer, extruded by `_HEIGHT` from z = 0, as binary STL."""
    flat, n = layer.plane.points, len(layer.points)
    points = np.concatenate([np.insert(flat, 2, z, axis=1) for z in (0.0, _HEIGHT)])
    triangles = [layer.triangles[:, ::-1], layer.triangles + n]
    for loop in layer.loops:
        after = np.roll(loop, -1)
        triangles += [
            np.stack(c, axis=1) for c in ((loop, after, after + n), (loop, after + n, loop + n))
        ]
    write_stl(path, points, np.concatenate(triangles))


def extrusion_lines(text: str, name: str = "G-code") -> list[FloatArray]:
    """Lines along which material is laid, from G-code of one layer.

    A line is a run of moves in X and Y during which E grows; anything else that moves in X or Y
    ends it. Knows G0 and G1, G90 and G91 (X, Y, Z), M82 and M83 (E), G92, G28 (the position is
    then unknown) and G21; other M commands, and comments, say nothing about the path.

    Parameters
    ----------
    name : str
        What error messages call it.

    Returns
    -------
    list of (k, 2) arrays, mm
        Where the printer's X and Y are at the ends of the moves.

    Raises
    ------
    InputError
        When a line is none of the above, material is laid from an unknown position, or on more
        than one height.
    """
    at = np.array([np.nan, np.nan, np.nan, 0.0])
    absolute = np.ones(4, dtype=bool)
    lines: list[list[FloatArray]] = []
    laying = False
    heights: set[float] = set()
    for number, raw in enumerate(text.splitlines(), start=1):
        command, words = _parse(raw, f"{name}, line {number}")
        if command in _MODES:
            axes, mode = _MODES[command]
            absolute[axes] = mode
        elif command == "G28":
            at[[k for k in range(3) if k in words or not words]] = np.nan
        elif command == "G92":
            for k in range(4):
                at[k] = words.get(k, at[k] if words else 0.0)
        elif command in ("G0", "G1"):
            start, at = at, at.copy()
            for k, value in words.items():
                at[k] = value if absolute[k] else start[k] + value
            if not (0 in words or 1 in words or 2 in words):
                continue  # E alone: the strand goes on after a pause
            if np.array_equal(start[:3], at[:3]):
                continue
            grows = at[3] > start[3]
            if grows:
                if not np.isfinite([start[:3], at[:3]]).all():
                    raise InputError(
                        f"{name}, line {number}: expected a known position before material is "
                        f"laid; got '{raw.strip()[:40]}': place the tool with G1 X Y Z first"
                    )
                heights |= {start[2], at[2]}
                if not laying:
                    lines.append([start[:2]])
                lines[-1].append(at[:2])
            laying = grows
    if len(heights) > 1:
        raise InputError(
            f"{name}: expected material on one height; got {len(heights)} from {min(heights):g} "
            f"to {max(heights):g} mm: slice one layer"
        )
    return [np.array(line) for line in lines]


def _parse(raw: str, where: str) -> tuple[str, dict[int, float]]:
    """Command of a line, "" for one that says nothing, and its values of X, Y, Z, E by index."""
    bare = raw.split(";", 1)[0].strip()
    command, *rest = bare.split() or [""]
    if command == "" or (command[0] == "M" and command[1:].isdigit()) or command == "G21":
        return command, {}
    matches = [_WORD.fullmatch(word) for word in rest]
    known = command in ("G0", "G1", "G28", "G90", "G91", "G92")
    letters = [match[1] for match in matches if match]
    if not known or None in matches or len(set(letters)) < len(rest) or set(letters) - set("XYZEF"):
        raise InputError(
            f"{where}: expected G0 or G1 with X, Y, Z, E, F, or G21, G28, G90, G91, G92, M..; got "
            f"'{bare[:40]}': slice without arcs, in mm"
        )
    values = {
        "XYZE".index(match[1]): float(match[2]) for match in matches if match and match[1] != "F"
    }
    return command, values


def main() -> None:
    """Print the alignment at full density, and below it what is stated."""
    case = authors_loop()
    field = solve(case.problem)["pull"]
    layers = case.slicing(field, case.build, case.machine)
    heads = ("< 10", "< 20", "< 30", "by stress", "< 20", "< 30", "mean angle", "efficiency")
    print(f"{'':28}" + "".join(f"{head:>12}" for head in (*heads, "mm/layer", "outside mm")))
    for name, (pattern, angle, turn) in PATTERNS.items():
        paths = slicer_paths(layers, pattern, angle, 1.0, turn)
        total = evaluate(paths, layers, field, case.machine).total
        values = [total[index] for index in _INDICES]
        values += [length_per_layer(paths, layers), total["outside_depth"]]
        print(f"{name:28}" + "".join(f"{value:12.4g}" for value in values))
        print(f"{'  stated':28}" + "".join(f"{value:12.4g}" for value in STATED[name]), flush=True)


if __name__ == "__main__":
    main()
