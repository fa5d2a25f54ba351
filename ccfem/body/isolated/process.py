"""A call in a process of its own: a crash, a hang or a flood of memory becomes an exception."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ccfem.base.errors import InputError

NOT_WRITTEN = 74
"""Exit code of a child that cannot write what it found, as on a full disk."""

_PACKAGES = Path(__file__).resolve().parents[3]
"""Folder from which ccfem is imported."""


class ChildError(RuntimeError):
    """A call that did not come to its end; the message says why, as part of a sentence."""


def in_own_process(
    function: str,
    seconds: float | None = None,
    memory: float = 0.0,
    work: float = 0.0,
    **arguments: Any,
) -> dict[str, Any]:
    """Call a function of `body.isolated` in a process of its own, on one core, without a word.

    Parameters
    ----------
    function : str
        ``module:name``. It returns a mapping of names to arrays, numbers and strings.
    seconds : float, optional
        The process is ended after this time.
    memory : float, bytes, optional
        Most address space that it may take; 0 for no limit.
    work : float, s, optional
        Most time of the processor that it may take, however busy the machine; 0 for no limit.
    **arguments : arrays, numbers and strings

    Returns
    -------
    dict of name to array; numbers and strings as arrays without dimension

    Raises
    ------
    InputError
        What the function raises itself, and a temporary folder that is full.
    ChildError
        For any other failure: too much time or memory, a crash, an exception.
    """
    environment = dict(os.environ)
    before = environment.get("PYTHONPATH")
    environment["PYTHONPATH"] = os.pathsep.join([str(_PACKAGES), *([before] if before else [])])
    for library in ("OMP", "OPENBLAS", "MKL"):
        environment[f"{library}_NUM_THREADS"] = "1"
    with TemporaryDirectory(prefix="ccfem-", ignore_cleanup_errors=True) as folder:
        given = {"function": function, "memory": memory, "work": work, **arguments}
        np.savez(Path(folder) / "in.npz", **given)
        command = [sys.executable, "-P", "-m", "ccfem.body.isolated.child", folder]
        try:
            done = subprocess.run(
                command,
                cwd=folder,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                timeout=seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise ChildError(f"it takes more than {seconds:.0f} s") from None
        out = Path(folder) / "out.npz"
        if done.returncode == NOT_WRITTEN:
            raise InputError(
                f"cannot write to the temporary folder {Path(folder).parent}: free some space "
                "there, or name another folder in the environment variable TMPDIR"
            )
        if work > 0.0 and _ending(done.returncode) == "SIGXCPU":
            raise ChildError(f"it takes more than {work:.0f} s")
        if not out.exists():
            raise ChildError(f"the library crashed ({_ending(done.returncode)})")
        with np.load(out, allow_pickle=False) as file:
            answer = {name: file[name] for name in file.files}
    if "refused" in answer:
        raise InputError(str(answer["refused"]))
    if "failed" in answer:
        raise ChildError(str(answer["failed"]))
    return answer


def _ending(code: int) -> str:
    """Say how a process ended."""
    if code < 0:
        try:
            return signal.Signals(-code).name
        except ValueError:
            return f"signal {-code}"
    return f"exit code {code}"


# Reading a file in a process of its own, with a limit of time and memory by the file's size.


_SECONDS, _PER_SECOND = 15.0, 2e6
"""Time of the processor for any file, and bytes that are given a second more."""
_BUSY = 4.0
"""How much more may go by until a busy machine gives it that time."""
_MEMORY, _PER_BYTE = 1.5e9, 40.0
"""Address space for any file, and what each of its bytes may take more."""


def read_isolated(function: str, path: Path, **more: Any) -> dict[str, Any]:
    """Call a reader of `ccfem.body.isolated` with a file, and more: see `in_own_process`."""
    size = path.stat().st_size
    work = _SECONDS + size / _PER_SECOND
    return in_own_process(
        function,
        seconds=_BUSY * work,
        work=work,
        memory=_MEMORY + _PER_BYTE * size,
        path=str(path.absolute()),
        **more,
    )
