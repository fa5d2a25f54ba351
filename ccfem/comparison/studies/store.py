"""The folder of a study: one file a run, written whole, under the hash of all it depends on."""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ccfem.base.errors import InputError
from ccfem.base.folder import Folder, sweep
from ccfem.base.result_folder import refuse_foreign, whole_folder

_LOCK = ".lock"
_RUNS = "runs"
TABLES = ("results.csv", "results.parquet", "times.csv", "study.html")


class Store:
    """Outcomes of runs by their hash, on disk.

    A run is there whole or not at all, however its program ended. Nothing is written or read
    through links.
    """

    def __init__(self, folder: Folder, force: bool = False) -> None:
        self._folder, self._force = folder, force

    def __getitem__(self, key: str) -> dict[str, Any] | None:
        """Outcome of a run; None where it is not there.

        Raises
        ------
        InputError
            Where something else has its place.
        """
        name = f"{key}.json"
        if self._folder.entry(_RUNS) is None:
            return None
        with self._folder.inner(_RUNS) as runs:
            if runs.entry(name) is None:
                return None
            try:
                outcome = json.loads(runs.read(name))
            except (OSError, ValueError, RecursionError):
                outcome = None
            if _is_outcome(outcome):
                return dict(outcome)
            if self._force and not runs.is_folder(name):
                return None
            raise InputError(
                f"{runs.path / name} is not a run that ccfem stored: move it, or choose another "
                "folder with --out"
            )

    def __setitem__(self, key: str, outcome: Mapping[str, Any]) -> None:
        text = json.dumps(outcome, indent=1, ensure_ascii=False, allow_nan=False)
        with self._folder.inner(_RUNS) as runs:
            runs.write(f"{key}.json", (text + "\n").encode())

    @contextmanager
    def writing(self, *names: str) -> Iterator[Path]:
        """Yield a temporary folder for files beside the runs: see `whole_folder`."""
        self._folder.check_place()
        with whole_folder(self._folder.path, names, self._force) as folder:
            yield folder

    def sweep(self) -> None:
        """Remove what killed programs left behind."""
        sweep(self._folder, ("study.json", *TABLES))
        if self._folder.is_folder(_RUNS):
            with self._folder.inner(_RUNS) as runs:
                sweep(runs, ())


def _is_outcome(value: Any) -> bool:
    """Whether a value is what is stored of a run."""
    try:
        for numbers in (value.get("values", {}), value.get("seconds", {})):
            for number in numbers.values():
                float(number)
        return isinstance(value["failure"], str)
    except (AttributeError, KeyError, TypeError, ValueError):
        return False


@contextmanager
def opened(folder: Path, force: bool = False) -> Iterator[Store]:
    """Open the folder of a study for one program alone.

    Parameters
    ----------
    folder : Path
        Made where it does not exist.
    force : bool, default False
        Take a folder with other files in it, and replace files of the names of results.

    Raises
    ------
    InputError
        When the folder holds files of something else, another program runs a study in it, or it
        cannot be written to.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"cannot write a study to {folder}: it is a file: name a folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with Folder.opened(folder) as held:
            refuse_foreign(held, ("study.json", *TABLES), force)
            lock = held.open(_LOCK, os.O_RDWR | os.O_CREAT)
            try:
                _lock(lock, folder)
                store = Store(held, force)
                store.sweep()
                yield store
            finally:
                os.close(lock)
    except OSError as error:
        raise InputError(
            f"cannot continue in {error.filename or folder}: {error.strerror or error}: finished "
            "runs are kept; correct this and repeat, or choose another folder with --out"
        ) from error


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
