"""The child: call the function that a folder names, and leave there what it returns."""

import importlib
import sys
from pathlib import Path

import numpy as np

from ccfem.base.errors import InputError
from ccfem.body.isolated.process import NOT_WRITTEN


def main() -> None:
    """Read ``in.npz``, call, write ``out.npz``; what goes wrong is written there as ``error``."""
    folder = Path(sys.argv[1])
    with np.load(folder / "in.npz", allow_pickle=False) as file:
        given = {name: file[name] for name in file.files}
    module, function = str(given.pop("function")).split(":")
    memory, work = float(given.pop("memory")), float(given.pop("work"))
    try:
        import resource
    except ImportError:  # not on Windows: there the limit of time alone holds
        pass
    else:
        if memory > 0.0:
            resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
        if work > 0.0:
            resource.setrlimit(resource.RLIMIT_CPU, (int(work) + 1, int(work) + 2))
    arguments = {name: value[()] if value.ndim == 0 else value for name, value in given.items()}
    try:
        arrays = getattr(importlib.import_module(f"ccfem.body.isolated.{module}"), function)(
            **arguments
        )
    except InputError as error:
        arrays = {"refused": str(error)}
    except MemoryError:
        arrays = {"failed": "it takes too much memory"}
    except Exception as error:
        arrays = {"failed": " ".join(f"{error}".split())[:200] or type(error).__name__}
    try:
        np.savez(folder / "new.npz", **arrays)
        (folder / "new.npz").rename(folder / "out.npz")
    except OSError:
        sys.exit(NOT_WRITTEN)


if __name__ == "__main__":
    main()
