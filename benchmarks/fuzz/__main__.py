"""Feed mutants of good files to the readers: each ends well, or in one line.

Run ``python -m benchmarks.fuzz [COUNT] [SEED] [FORMATS,...]``: by default 3,000 mutants over all
formats. The format ``sizes`` stands for part files with one size changed over twelve decades, which
are solved: each is refused in one line, or its numbers are finite, balance, and are remarked on
where the part moves by more than a twentieth of its size. Whatever else a file does is printed, and
the file is kept under ``results/fuzz``.
"""

import os
import random
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.fuzz.mutants import MESH, good_files, mutants, part_of_sizes
from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh, read_surface
from ccfem.body.files.surface import is_surface
from ccfem.cases.part_file import deck_part, read_part
from ccfem.fem.elasticity import solve
from ccfem.fem.elasticity.system import prepare
from ccfem.fem.stress_files import read_stress
from ccfem.printing.export.path_table import read_paths

SECONDS, MEMORY = 20.0, 2e9


def read(path: Path) -> None:
    """Read a file as ccfem does by its name."""
    if "stress" in path.stem:
        read_stress(path, MESH, "MPa" if path.suffix == ".xdmf" else None,
                    step=2 if path.suffix == ".xdmf" else None)  # fmt: skip
    elif "analysis" in path.stem:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            deck_part(path)
    elif "paths" in path.stem:
        read_paths(path, np.eye(3))
    elif path.suffix == ".toml":
        read_part(path)
    elif is_surface(path):
        read_surface(path)
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # remarks on the mesh
            read_mesh(path, check=False)


def solve_sizes(path: Path) -> None:
    """Solve a part file; raise where the answer cannot be right and nothing is said."""
    case = read_part(path)
    for field in solve(case.problem).values():
        both = field.reactions + prepare(field.problem).forces_in(field.case)
        sizes = np.abs(field.reactions).sum()
        assert np.isfinite(field.displacement).all()
        assert field.strain_energy >= 0.0
        assert np.abs(both.sum(axis=0)).max() <= 1e-3 * sizes
        far = np.ptp(field.displacement, axis=0) / np.ptp(field.mesh.points)
        assert field.findings or np.linalg.norm(far) <= 0.06


def verdict(path: Path, see: Callable[[Path], object] = read, limit: float = SECONDS) -> str:
    """Read a file in a process of its own: "read", "refused", or what is wrong.

    More than `limit` seconds are wrong; after twice as many the process is ended.
    """
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            os.setsid()
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            code = 1
            try:
                see(path)
                code = 0
            except InputError as error:
                one = all("\n" not in line and len(line) < 2000 for line in error.mistakes)
                code = 2 if one and str(error) else 3
            except BaseException:
                import traceback

                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)
        start = time.perf_counter()
        while True:
            ended, status, used = os.wait4(child, os.WNOHANG)
            seconds = time.perf_counter() - start
            if ended:
                break
            if seconds > 2.0 * limit:
                os.killpg(child, signal.SIGKILL)
            time.sleep(0.002 if seconds < 1.0 else 0.05)
        said.seek(0)
        text = said.read().decode(errors="replace").strip()
    code = os.waitstatus_to_exitcode(status)
    if used.ru_maxrss * 1024 > MEMORY:
        return f"{used.ru_maxrss / 1e6:.1f} GB"
    if seconds > limit:
        return f"{seconds:.0f} s"
    if code not in (0, 2):
        return f"code {code}: {text.splitlines()[-1] if text else ''}"
    return f"says {text[:200]}" if text else ("refused" if code else "read")


def main(count: int = 3000, seed: str = "1", wanted: tuple[str, ...] = ()) -> int:
    """Try `count` mutants over all formats; return how many are not met as they should be."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    tally: Counter[str] = Counter()
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = [f for f in good_files(folder) if not wanted or f.suffix[1:] in wanted]
        if not wanted or "sizes" in wanted:
            chance, target = random.Random(seed), folder / "sizes.toml"
            for k in range(count // (len(files) + 1)):
                text, _ = part_of_sizes(chance)
                target.write_text(text)
                found = verdict(target, solve_sizes)
                tally[f"sizes {found if found in ('read', 'refused') else 'WRONG'}"] += 1
                if found not in ("read", "refused"):
                    wrong += 1
                    print(f"sizes {k}: {found}\n{text}", flush=True)
        for file in files:
            before = time.perf_counter()
            content = file.read_bytes()
            target = file.with_name(f"mutant_{file.name}")
            for k, spoiled in enumerate(mutants(content, count // len(files), seed + file.name)):
                target.write_bytes(spoiled)
                found = verdict(target)
                tally[f"{file.suffix} {found if found in ('read', 'refused') else 'WRONG'}"] += 1
                if found not in ("read", "refused"):
                    wrong += 1
                    kept = Path("results/fuzz")
                    kept.mkdir(parents=True, exist_ok=True)
                    (kept / f"{file.stem}-{seed}-{k}{file.suffix}").write_bytes(spoiled)
                    print(f"{file.name} {k}: {found}", flush=True)
            print(f"{file.name}: {time.perf_counter() - before:.0f} s", flush=True)
    print(dict(sorted(tally.items())))
    print(f"{sum(tally.values())} mutants, {wrong} not met as they should be")
    return wrong


if __name__ == "__main__":
    given = sys.argv[1:]
    count, seed, formats, *_ = *given, *("3000", "1", "")[len(given) :]
    sys.exit(bool(main(int(count), seed, tuple(filter(None, formats.split(","))))))
