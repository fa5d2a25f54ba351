"""Running a study: what is not in its folder yet is run, stored run by run, and summed up."""

import base64
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from html import escape
from importlib.util import find_spec
from pathlib import Path
from tempfile import gettempdir
from typing import Any, BinaryIO, cast
from uuid import uuid4

from ccfem.base.checks import check_number
from ccfem.base.cluster import connected
from ccfem.base.csv_table import write_csv
from ccfem.base.errors import InputError, spared
from ccfem.base.folder import Folder, private_folder, sweep
from ccfem.base.parallel import processors
from ccfem.base.progress import Progress, silent
from ccfem.base.result_folder import refuse_foreign, whole_folder
from ccfem.comparison.front import FRONTS
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.studies.definition import Study, read_study
from ccfem.comparison.studies.jobs import Job, Jobs, Outcome, jobs_of
from ccfem.comparison.studies.study_result import StudyResult, shown_table
from ccfem.comparison.studies.transport import packed, unpacked
from ccfem.comparison.studies.work import crashed, job_bytes, part_bytes, run_job, solve_part
from ccfem.comparison.studies.worker import receive, send


def study(
    what: str | os.PathLike[str] | Study,
    out: str | os.PathLike[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    force: bool = False,
    progress: Progress = silent,
) -> StudyResult:
    """Run a study: parts x slicings x strategies x parameters.

    Each part is solved once for all its runs. Each run is stored as soon as it is made, under a
    hash of what it depends on: a study that was stopped, or killed, goes on where it was, and one
    that was changed makes the new runs only. A run that fails stays in the table, with the reason;
    one that ended in a crash is tried again next time.

    Parameters
    ----------
    what : str, path or Study
        A study file (`ccfem.comparison.studies.Study` tells what it holds), or a study.
    out : path, optional
        Folder; default ``results/`` and the name of the study. It then holds ``results.csv``,
        ``results.parquet`` (where pyarrow is installed), ``times.csv``, ``study.html``,
        ``study.json`` and ``runs/``.
    workers : int, optional
        Processes of this machine; by default as many as processors. With 0 this process makes the
        runs itself.
    scheduler : str, optional
        Address of a Dask scheduler whose workers make the runs instead.
    force : bool, default False
        Take a folder with other files in it, and replace those of the names of results.
    progress : callable, optional
        Told what was done last, the time left, and the share that is done.

    Raises
    ------
    InputError
        For anything wrong with the study, before anything is solved or written; for a folder that
        another program works in, and a disk that is full.
    """
    definition = what if isinstance(what, Study) else read_study(what)
    if workers is not None:
        check_number("workers", workers, at_least=0)
    jobs = jobs_of(definition, progress)
    folder = Path("results") / definition.name if out is None else Path(out)
    with opened(folder, force) as store:
        known = {job.key: store[job.key] for job in jobs.jobs}
        outcomes = {k: row for k, row in known.items() if row and not row.get("crashed")}
        missing = [job for job in jobs.jobs if job.key not in outcomes]
        with store.writing("study.json") as files:
            (files / "study.json").write_text(_about(definition, jobs), encoding="utf-8")
        count = processors() if workers is None else workers
        tell = _Teller(progress, len(jobs.jobs), len(outcomes))
        try:
            with closing(_made(definition, jobs, missing, count, scheduler)) as made:
                for job, outcome in made:
                    store[job.key] = outcome
                    outcomes[job.key] = outcome
                    tell(job, outcome)
        finally:  # also where it was stopped: the tables say what is missing
            made_now = len(missing) - sum(job.key not in outcomes for job in missing)
            result = StudyResult(
                definition.name, folder, jobs.jobs, outcomes, jobs.repeated, made_now
            )
            if outcomes:
                with store.writing(*TABLES) as files:
                    _write_tables(result, files)
        return result


def _made(
    definition: Study, jobs: Jobs, missing: list[Job], workers: int, address: str | None
) -> Generator[tuple[Job, Outcome], None, None]:
    """Make runs, wherever that is."""
    if not missing:
        return
    strand = definition.strand if definition.virtual_test else None
    parts = {
        number: part_bytes(jobs.parts[number], strand, definition.backend)
        for number in dict.fromkeys(job.part for job in missing)
    }
    if address is not None:
        yield from on_cluster(parts, missing, address)
    elif workers:
        with Folder.opened(Path(gettempdir())) as temporary:
            sweep(temporary, ("*.npz",))
        with private_folder() as shared:
            yield from in_processes(parts, missing, workers, shared)
    else:
        yield from _here(parts, missing)


def _here(
    parts: Mapping[int, bytes], jobs: list[Job]
) -> Generator[tuple[Job, Outcome], None, None]:
    """Make runs in this process."""
    for number, task in parts.items():
        stress, name = solve_part(task), uuid4().hex
        for job in jobs:
            if job.part == number:
                yield job, run_job(stress, name, job_bytes(job))


def _write_tables(result: StudyResult, folder: Path) -> None:
    """Write ``results.csv``, ``results.parquet``, ``times.csv`` and ``study.html``."""
    frame = result.frame
    for file, table in (("results.csv", frame), ("times.csv", result.seconds)):
        write_csv(folder / file, [*table], table.itertuples(index=False))
    if find_spec("pyarrow") is not None:
        plain = frame.copy()
        for name in frame:  # a column of numbers and words becomes one of words
            if len({type(value) for value in frame[name].dropna()}) > 1:
                plain[name] = frame[name].map(lambda v: v if v is None else str(v))
        plain.to_parquet(folder / "results.parquet", index=False)
    with spared("study.html", []):
        (folder / "study.html").write_text(study_page(result), encoding="utf-8")


def _about(definition: Study, jobs: Jobs) -> str:
    """Say what the study runs, as JSON."""
    runs = [{"key": job.key, **job.labels} for job in jobs.jobs]
    about = {"name": definition.name, "virtual_test": definition.virtual_test, "runs": runs}
    return json.dumps(about, indent=1, ensure_ascii=False) + "\n"


class _Teller:
    """Tells how far a study is, and how long it may still take."""

    def __init__(self, progress: Progress, total: int, done: int) -> None:
        self._progress, self._total, self._done = progress, total, done
        self._first, self._failed = done, 0
        self._start = time.monotonic()
        if done:
            progress(f"{done} of {total} runs were already done", done / total)

    def __call__(self, job: Job, outcome: Outcome) -> None:
        self._done += 1
        self._failed += bool(outcome["failure"])
        seconds = (time.monotonic() - self._start) / (self._done - self._first)
        left = _duration(seconds * (self._total - self._done))
        failed = f", {self._failed} failed" if self._failed else ""
        line = f"{self._done} of {self._total} runs{failed}, about {left} left: {job.name}"
        self._progress(line, self._done / self._total)


def _duration(seconds: float) -> str:
    """Time in the unit that fits."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


# The page of a study: its fronts and its table, complete in itself.


_HEADINGS = {
    "fibre_length": "Stiffness over fibre",
    "print_time_nearest": "Stiffness over the time to lay the fibre",
    "first_failure_load": "Stiffness over failure load",
}


def study_page(result: StudyResult) -> str:
    """Write the page."""
    parts = [f"<h1>{escape(result.name)}</h1><p>{escape(result.about)}</p>"]
    parts += [f'<p class="remark">{escape(line)}</p>' for line in result.remarks]
    for cost in FRONTS:
        if not result.frame[f"front_{cost}"].any():
            continue
        picture = base64.b64encode(png(result.plot(cost))).decode()
        parts.append(
            f"<h2>{_HEADINGS[cost]}</h2>"
            f'<img alt="{_HEADINGS[cost]}" src="data:image/png;base64,{picture}">'
        )
    parts.append(
        "<p>Large points, joined by a line: no other printable run is better in one and as good in "
        "the other. Hollow points cannot be printed as they are. A click on a heading sorts.</p>"
        f'<h2>Runs</h2><div class="wide">{shown_table(result.frame)}</div>'
    )
    body = "\n".join(parts)
    page = Path(__file__).with_name("study.html").read_text(encoding="utf-8")
    return page.replace("@TITLE@", escape(result.name)).replace("@BODY@", body)


# Runs of a study on a Dask cluster.


def on_cluster(
    parts: Mapping[int, bytes], jobs: Sequence[Job], address: str
) -> Iterator[tuple[Job, Outcome]]:
    """Run jobs, each part solved once, and yield each with its outcome as soon as it is there.

    Workers need no files in common: stress goes to them, and outcomes come back, by the cluster.

    Parameters
    ----------
    parts : mapping of number to bytes
        Task of each part that jobs need, from `part_bytes`.
    address : str
        Of the scheduler, as ``tcp://host:8786``.
    """
    with connected(address) as client:
        from distributed import as_completed

        stress = {
            number: client.submit(solve_part, task, pure=False) for number, task in parts.items()
        }
        owners: dict[Any, Job] = {}
        for job in jobs:
            task = (stress[job.part], f"{client.id}-{job.part}", job_bytes(job))
            owners[client.submit(run_job, *task, pure=False)] = job
        for future in as_completed(list(owners)):
            job, failed = owners.pop(future), future.exception()
            if failed is None:
                yield job, future.result()
            else:  # a worker that was killed, again and again
                yield job, crashed(" ".join(f"{type(failed).__name__}: {failed}".split()))


# The folder of a study: one file a run, written whole, under the hash of all it depends on.


_LOCK = ".lock"
_RUNS = "runs"
TABLES = ("results.csv", "results.parquet", "times.csv", "study.html")
_FILES = ("study.json", *TABLES)


class Store:
    """Outcomes of runs by their hash, on disk.

    A run is there whole or not at all, however its program ended. Nothing is written or read
    through links.
    """

    def __init__(self, folder: Folder, force: bool = False) -> None:
        self._folder, self._force = folder, force

    def __getitem__(self, key: str) -> Outcome | None:
        """Outcome of a run; None where it is not there."""
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
                return cast(Outcome, outcome)
            if self._force and not runs.is_folder(name):
                return None
            raise InputError(
                f"{runs.path / name} is not a run that ccfem stored: move it, or choose another "
                "folder with --out"
            )

    def __setitem__(self, key: str, outcome: Outcome) -> None:
        text = json.dumps(outcome, indent=1, ensure_ascii=False, allow_nan=False)
        with self._folder.inner(_RUNS) as runs:
            runs.write(f"{key}.json", (text + "\n").encode())

    @contextmanager
    def writing(self, *names: str) -> Iterator[Path]:
        """Yield a temporary folder for files beside the runs: see `whole_folder`."""
        self._folder.check_place()
        with whole_folder(self._folder.path, names, self._force, _FILES) as folder:
            yield folder

    def sweep(self) -> None:
        """Remove what killed programs left behind."""
        sweep(self._folder, _FILES)
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
            refuse_foreign(held, _FILES, force)
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


# Runs of a study in processes of this machine.


_PACKAGES = Path(__file__).resolve().parents[3]
"""Folder from which ccfem is imported."""

_Done = queue.SimpleQueue[tuple["_Worker", bytes | None]]


def in_processes(
    parts: Mapping[int, bytes], jobs: Sequence[Job], workers: int, folder: Path
) -> Iterator[tuple[Job, Outcome]]:
    """Run jobs, each part solved once, and yield each with its outcome as soon as it is there.

    Parameters
    ----------
    parts : mapping of number to bytes
        Task of each part that jobs need, from `part_bytes`.
    workers : int
        Processes; each has its share of the processors for its threads.
    folder : Path
        Where the stress of parts is kept meanwhile, as arrays; nobody else may write there.
    """
    done: _Done = queue.SimpleQueue()
    board = _Board(parts, jobs)
    crew = [_Worker(done, workers) for _ in range(max(min(workers, len(jobs)), 1))]
    left = len(jobs)
    try:
        while left:
            for worker in crew:
                if worker.task is None:
                    worker.take(board, folder)
            worker, answer = done.get()
            if answer is None:
                task = worker.task
                crew[crew.index(worker)] = _Worker(done, workers)
                if task is None:
                    continue
                failed = crashed(f"the process that ran it ended: {worker.ending()}")
                for job in board.lost(task):
                    left -= 1
                    yield job, failed
                continue
            task, worker.task = worker.task, None
            if isinstance(task, Job):
                left -= 1
                yield task, unpacked(answer)
            else:
                board.solved[cast(int, task)] = unpacked(answer)
    finally:
        for worker in crew:
            worker.end()


@dataclass
class _Board:
    """What there is to do."""

    parts: Mapping[int, bytes]
    jobs: Sequence[Job]
    waiting: dict[int, deque[Job]] = field(init=False)
    unsolved: deque[int] = field(init=False)
    solved: dict[int, bytes] = field(default_factory=dict)
    """Of each solved part what stands in no array: see `transport.parted`."""

    def __post_init__(self) -> None:
        self.waiting = {number: deque() for number in self.parts}
        for job in self.jobs:
            self.waiting[job.part].append(job)
        self.unsolved = deque(self.parts)

    def next(self, held: int | None) -> Job | int | None:
        """Give a run on the part that a worker holds, else a part to solve, else any run."""
        if held in self.solved and self.waiting[held]:
            return self.waiting[held].popleft()
        if self.unsolved:
            return self.unsolved.popleft()
        ready = [number for number in self.solved if self.waiting[number]]
        if not ready:
            return None
        return self.waiting[max(ready, key=lambda number: len(self.waiting[number]))].popleft()

    def lost(self, task: Job | int) -> list[Job]:
        """Give up what a process that ended was doing: a run, or all runs of a part."""
        if isinstance(task, Job):
            return [task]
        jobs = list(self.waiting[task])
        self.waiting[task].clear()
        return jobs


class _Worker:
    """A process, and what it is doing."""

    def __init__(self, done: _Done, workers: int) -> None:
        self.task: Job | int | None = None
        self._held: int | None = None
        command = [sys.executable, "-P", "-m", "ccfem.comparison.studies.worker"]
        self._process = subprocess.Popen(
            command,
            env=_environment(workers),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._given = cast(BinaryIO, self._process.stdin)
        self._out = cast(BinaryIO, self._process.stdout)
        self._tell(json.dumps([os.path.abspath(path) for path in sys.path]).encode())
        threading.Thread(target=self._listen, args=(done,), daemon=True).start()

    def _listen(self, done: _Done) -> None:
        while True:
            answer = receive(self._out)
            done.put((self, answer))
            if answer is None:
                return

    def _tell(self, data: bytes) -> None:
        with suppress(BrokenPipeError):  # where it has ended, which its listener tells
            send(self._given, data)

    def take(self, board: _Board, folder: Path) -> None:
        """Begin what is next to do, if anything is."""
        task = self.task = board.next(self._held)
        if task is None:
            return
        if isinstance(task, Job):
            part, what, data, rest = task.part, "run", job_bytes(task), board.solved[task.part]
        else:
            part, what, data, rest = task, "solve", board.parts[task], b""
        self._held = part
        self._tell(packed((what, str(part), str(folder / f"{part}.npz"), data, rest)))

    def ending(self) -> str:
        """Say how the process ended."""
        code = self._process.wait()
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()


def _environment(workers: int) -> dict[str, str]:
    """Environment in which the threads of all workers together are as many as processors.

    Libraries take one thread each: how they share sums among more would change the last digits, and
    so the table with the number of workers.
    """
    environment = dict(os.environ)
    before = environment.get("PYTHONPATH")
    environment["PYTHONPATH"] = os.pathsep.join([str(_PACKAGES), *([before] if before else [])])
    for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
        environment[f"{library}_NUM_THREADS"] = "1"
    environment["CCFEM_THREADS"] = str(max(processors() // workers, 1))
    return environment
