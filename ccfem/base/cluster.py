"""The workers of a Dask scheduler: side by side on other machines what `in_processes` does here."""

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, version
from typing import Any
from uuid import uuid4

from ccfem.base.errors import InputError
from ccfem.base.parallel import ReadOnlyPickler, done_elsewhere

_PATIENCE = 30.0
"""Seconds to wait for a scheduler."""


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Yield a client of a Dask scheduler whose workers have this version of ccfem.

    Parameters
    ----------
    address : str
        Of the scheduler, as ``tcp://host:8786``.

    Raises
    ------
    InputError
        Where Dask is not installed, the scheduler does not answer, has no workers, or these have
        another version of ccfem.
    """
    try:
        from distributed import Client
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
        yield client


def _check_workers(client: Any, address: str) -> None:
    """Refuse a cluster without workers, and workers with another version."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except TimeoutError:
        raise InputError(
            f"the Dask scheduler at {address} has no workers: start some with dask worker {address}"
        ) from None
    here = version("ccfem")
    for name, there in client.run(_version).items():
        if there != here:
            raise InputError(
                f"worker {name} has ccfem {there}, this is {here}: install the same on both"
            )


def _version() -> str:
    """Version of ccfem on a worker."""
    try:
        return version("ccfem")
    except PackageNotFoundError:
        return "not at all"


@contextmanager
def on_cluster(address: str | None) -> Iterator[None]:
    """Let the workers of a scheduler do what `in_processes` shares out within this.

    Results are the same to the last bit. Work that cannot be sent, as with a factorised matrix, is
    done here, side by side as always.

    Parameters
    ----------
    address : str, optional
        Of the scheduler; None leaves everything here.

    Raises
    ------
    InputError
        As of `connected`, and where a worker is lost again and again.
    """
    if address is None:
        yield
        return
    with connected(address) as client, done_elsewhere(lambda *asked: _results(client, *asked)):
        yield


def _results(
    client: Any, work: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]
) -> Iterator[Any] | None:
    """Results of work by the workers of a cluster, in order; None where it cannot be sent."""
    try:
        content = _dumped((work, arguments))
    except Exception:  # whatever a value that cannot be pickled raises
        return None
    key, sent = uuid4().hex, client.scatter(content, hash=False)
    futures = [
        client.submit(_result, sent, key, number, pure=False) for number in range(len(arguments))
    ]
    return _in_order(futures)


def _in_order(futures: Sequence[Any]) -> Iterator[Any]:
    from distributed import KilledWorker

    for future in futures:
        try:
            outcome = future.result()
        except KilledWorker:
            raise InputError(
                "a worker of the cluster ended before its work, again and again, as where memory "
                "runs out: start workers with fewer threads"
            ) from None
        yield _loaded(outcome)


def _dumped(value: Any) -> bytes:
    """Value as bytes, functions of a notebook included; what is read-only stays so."""
    from cloudpickle import CloudPickler

    class Pickler(ReadOnlyPickler, CloudPickler):
        pass

    content = io.BytesIO()
    Pickler(content).dump(value)
    return content.getvalue()


def _loaded(content: bytes) -> Any:
    from cloudpickle import loads

    return loads(content)


_read: dict[str, Any] = {}
"""Last work that this worker was sent, under its key."""


def _result(content: bytes, key: str, number: int) -> bytes:
    """Do one piece of work on a worker."""
    task = _read.get(key)
    if task is None:
        _read.clear()
        task = _read[key] = _loaded(content)
    work, arguments = task
    return _dumped(work(*arguments[number]))
