"""An existing Dask cluster by its address."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from tendonff.compensator.files.reading import InputError


@contextmanager
def executor_of(address: str | None) -> Iterator[Executor | None]:
    """An executor on the cluster, which stays up; None for this machine.

    Parameters
    ----------
    address : str or None
        Such as tcp://host:8786.

    Raises
    ------
    InputError
        If Dask is not installed, or no cluster answers.
    """
    if address is None:
        yield None
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError('--scheduler needs Dask: pip install "tendonff[distributed]"') from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: no Dask cluster answers there: {error}") from None
    with client:
        yield client.get_executor()
