"""Reading a file in a process of its own, with a limit of time and memory by the file's size."""

from pathlib import Path
from typing import Any

from ccfem.body.isolated.process import in_own_process

_SECONDS, _PER_SECOND = 15.0, 2e6
"""Time of the processor for any file, and bytes that are given a second more."""
_BUSY = 4.0
"""How much more may go by until a busy machine gives it that time."""
_MEMORY, _PER_BYTE = 1.5e9, 40.0
"""Address space for any file, and what each of its bytes may take more."""


def read_isolated(function: str, path: Path) -> dict[str, Any]:
    """Call a reader of `ccfem.body.isolated` with a file: see `in_own_process`."""
    size = path.stat().st_size
    work = _SECONDS + size / _PER_SECOND
    return in_own_process(
        function,
        seconds=_BUSY * work,
        work=work,
        memory=_MEMORY + _PER_BYTE * size,
        path=str(path.absolute()),
    )
