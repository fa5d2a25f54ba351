"""The folder of a study: one file a run, written whole, under the hash of all it depends on."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ccfem.errors import InputError
from ccfem.io.whole import whole_file

__all__ = ["Store", "opened"]

_MARKER = "study.json"
_LOCK = ".lock"


class Store:
    """Outcomes of runs by their hash, on disk.

    A run is there whole or not at all, however its program ended.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._runs = folder / "runs"

    def __getitem__(self, key: str) -> dict[str, Any] | None:
        """Outcome of a run; None where it is not there, or cannot be read."""
        try:
            found = json.loads((self._runs / f"{key}.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return found if isinstance(found, dict) and "failure" in found else None

    def __setitem__(self, key: str, outcome: Mapping[str, Any]) -> None:
        self._runs.mkdir(exist_ok=True)
        text = json.dumps(outcome, indent=1, ensure_ascii=False, allow_nan=False)
        with whole_file(self._runs / f"{key}.json") as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    @property
    def scratch(self) -> Path:
        """Folder for what workers share; emptied when a study begins and ends."""
        path = self.folder / ".stress"
        path.mkdir(exist_ok=True)
        return path

    def sweep(self) -> None:
        """Remove what killed programs left behind."""
        for path in [*self._runs.glob(".*.json"), *self.folder.glob(".stress/*")]:
            path.unlink()
        if (self.folder / ".stress").exists():
            (self.folder / ".stress").rmdir()


@contextmanager
def opened(folder: Path, force: bool = False) -> Iterator[Store]:
    """Open the folder of a study for one program alone.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    force : bool, default False
        Take a folder with other files in it.

    Raises
    ------
    InputError
        When the folder holds files of something else, another program runs a study in it, or it
        cannot be written to.
    """
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"cannot write a study to {folder}: it is a file: name a folder")
        others = [] if not folder.exists() else sorted(path.name for path in folder.iterdir())
        if others and _MARKER not in others and _LOCK not in others and not force:
            raise InputError(
                f"{folder} holds files of something else, such as {others[0]}: choose another "
                "folder with --out, or take it with --force"
            )
        folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(
            f"cannot write a study to {folder}: {error.strerror or error}: choose another folder "
            "with --out"
        ) from error
    try:
        _lock(lock, folder)
        store = Store(folder)
        store.sweep()
        yield store
        store.sweep()
    except OSError as error:
        raise InputError(
            f"cannot continue in {folder}: {error.strerror or error}: finished runs are kept; "
            "correct this and repeat"
        ) from error
    finally:
        os.close(lock)


def _lock(handle: int, folder: Path) -> None:
    """Keep other programs out; where a system or file system has no such locks, do without."""
    try:
        import fcntl

        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"another program runs a study in {folder}: wait for it, or choose another folder with "
            "--out"
        ) from None
    except (ImportError, OSError):
        pass
