"""Runs of a study on a Dask cluster."""

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from typing import Any

from ccfem.base.errors import InputError
from ccfem.comparison.studies.jobs import Job
from ccfem.comparison.studies.work import crashed, job_bytes, run_job, solve_part

_PATIENCE = 30.0
"""Seconds to wait for a scheduler."""


def on_cluster(
    parts: Mapping[int, bytes], jobs: Sequence[Job], address: str
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Run jobs, each part solved once, and yield each with its outcome as soon as it is there.

    Workers need no files in common: stress goes to them, and outcomes come back, by the cluster.

    Parameters
    ----------
    parts : mapping of number to bytes
        Task of each part that jobs need, from `part_bytes`.
    jobs : sequence of Job
    address : str
        Of the scheduler, as ``tcp://host:8786``.

    Raises
    ------
    InputError
        Where Dask is not installed, the scheduler does not answer, has no workers, or these have
        another version of ccfem.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError(
            "--scheduler needs Dask, which is not installed: pip install 'ccfem[dask]'"
        ) from None
    try:
        client = Client(address, timeout=_PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address} ({type(error).__name__}): start it with "
            "dask scheduler, and workers with dask worker"
        ) from None
    with client:
        _check_workers(client, address)
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


def _check_workers(client: Any, address: str) -> None:
    """Refuse a cluster without workers, and workers with another version."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise InputError(
            f"the Dask scheduler at {address} has no workers: start some with dask worker {address}"
        ) from None
    own = version("ccfem")
    for name, there in client.run(_version).items():
        if there != own:
            raise InputError(
                f"worker {name} has ccfem {there}, this is {own}: install the same on both"
            )


def _version() -> str:
    """Version of ccfem on a worker."""
    try:
        return version("ccfem")
    except ModuleNotFoundError:
        return "not at all"
