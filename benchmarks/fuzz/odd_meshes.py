"""Check parts of odd shape: each is seen through, or refused in one line.

Run ``python -m benchmarks.fuzz.odd_meshes``. Tetrahedra come as .npz, surfaces as .obj that are
meshed on the way; each is held at two facets below and pulled at one above.
"""

import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.fuzz.__main__ import verdict
from benchmarks.fuzz.odd_shapes import odd_grids, odd_shells
from ccfem.base.errors import InputError
from ccfem.cases.inspection import check

__all__ = ["odd_parts", "see"]

PART = """material = "pla"
{body}
[patches.foot]
rule = "nearest"
point = [3, 4, -1000]
count = 2
[patches.head]
rule = "nearest"
point = [5, 6, 1000]
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "force"
patch = "head"
vector = [0, 0, 10]
"""


def odd_parts(folder: Path) -> Iterator[tuple[str, Path]]:
    """Write a part file for each odd shape; give its name and file."""
    for k, (name, points, cells) in enumerate(odd_grids()):
        np.savez(folder / f"grid{k}.npz", points=points, cells=cells)
        part = folder / f"grid{k}.toml"
        part.write_text(PART.format(body=f'mesh = "grid{k}.npz"'))
        yield name, part
    for k, (name, points, triangles) in enumerate(odd_shells()):
        rows = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(points, float).tolist()]
        rows += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
        (folder / f"shell{k}.obj").write_text("\n".join(rows) + "\n")
        finite = points[np.isfinite(points).all(axis=1)]
        size = 0.15 * float(np.linalg.norm(np.ptp(finite, axis=0)))
        part = folder / f"shell{k}.toml"
        part.write_text(PART.format(body=f'surface = "shell{k}.obj"\nedge_length = {size!r}'))
        yield name, part


def see(part: Path) -> None:
    """Do what ``ccfem check`` does, but for the picture."""
    checked = check(part)
    str(checked)
    if checked.mistakes:
        raise InputError(*checked.mistakes)


def main() -> int:
    """Check all; return how many are not met as they should be."""
    os.environ["CCFEM_CACHE"] = ""
    tally: Counter[str] = Counter()
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name, part in odd_parts(Path(folder)):
            start = time.perf_counter()
            found = verdict(part, see)
            seconds = time.perf_counter() - start
            slowest = max(slowest, seconds)
            kind = found if found in ("read", "refused") else "WRONG"
            tally[f"{part.stem.rstrip('0123456789')} {kind}"] += 1
            print(f"{name}: {found}, {seconds:.1f} s", flush=True)
    wrong = sum(count for kind, count in tally.items() if kind.endswith("WRONG"))
    print(dict(sorted(tally.items())))
    print(
        f"{sum(tally.values())} odd parts, {wrong} not met as they should be, {slowest:.1f} s most"
    )
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main()))
