"""Running a study: what is not in its folder yet is run, stored run by run, and summed up."""

import json
import os
import time
from collections.abc import Generator, Mapping
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path
from tempfile import gettempdir
from typing import Any
from uuid import uuid4

from ccfem.base.checks import check_number
from ccfem.base.csv_table import write_csv
from ccfem.base.errors import spared
from ccfem.base.folder import Folder, private_folder, sweep
from ccfem.base.progress import Progress, silent
from ccfem.comparison.studies.cluster import on_cluster
from ccfem.comparison.studies.definition import Study, read_study
from ccfem.comparison.studies.jobs import Job, Jobs, jobs_of
from ccfem.comparison.studies.page import study_page
from ccfem.comparison.studies.processes import in_processes
from ccfem.comparison.studies.store import TABLES, opened
from ccfem.comparison.studies.study_result import StudyResult
from ccfem.comparison.studies.work import job_bytes, part_bytes, run_job, solve_part


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
        outcomes = {k: each for k, each in known.items() if each and not each.get("crashed")}
        missing = [job for job in jobs.jobs if job.key not in outcomes]
        with store.writing("study.json") as files:
            (files / "study.json").write_text(_about(definition, jobs), encoding="utf-8")
        count = (os.cpu_count() or 1) if workers is None else workers
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
    definition: Study,
    jobs: Jobs,
    missing: list[Job],
    workers: int,
    address: str | None,
) -> Generator[tuple[Job, dict[str, Any]], None, None]:
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
) -> Generator[tuple[Job, dict[str, Any]], None, None]:
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

    def __call__(self, job: Job, outcome: dict[str, Any]) -> None:
        self._done += 1
        self._failed += bool(outcome["failure"])
        each = (time.monotonic() - self._start) / (self._done - self._first)
        left = _duration(each * (self._total - self._done))
        failed = f", {self._failed} failed" if self._failed else ""
        said = f"{self._done} of {self._total} runs{failed}, about {left} left: {job.name}"
        self._progress(said, self._done / self._total)


def _duration(seconds: float) -> str:
    """Time in the unit that fits."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
