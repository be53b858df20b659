"""Workers of a Dask cluster: beyond one machine (https://distributed.dask.org)."""

import logging
from concurrent.futures import CancelledError, Executor
from typing import Any

from hil.errors import BrakebenchError, in_words
from hil.extras import pip_install

_CONNECT_S = 10


class ClusterError(BrakebenchError):
    """A cluster that cannot be used; the message says where, and what to do."""


class DaskWorkers:
    """Workers of a scheduler that runs already; it gives a task up that has ended four of them.

    Parameters
    ----------
    address : of the scheduler, as ``tcp://127.0.0.1:8786`` or ``tls://...``.

    Raises
    ------
    ClusterError : Dask is missing, nobody answers there, or the cluster has no worker.
    """

    kills = 4  # distributed.scheduler.allowed-failures (3), and the last

    def __init__(self, address: str) -> None:
        try:
            import distributed
        except ImportError as error:
            raise ClusterError(f"--scheduler needs Dask: {pip_install('campaign')}") from error
        logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost connection is told below, in one line
        self.name = f"--scheduler {address}"
        client: Any = distributed.Client
        try:
            self._client = client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"--scheduler {address}: nobody answers there ({in_words(error)}); start one with `dask scheduler "
                "--host 127.0.0.1`, and workers with `dask worker ADDRESS`"
            ) from error
        self.count = sum(self._client.nthreads().values())
        if not self.count:
            self._client.close()
            raise ClusterError(f"--scheduler {address}: no worker; start some with `dask worker {address}`")

    def open(self, _count: int) -> Executor:
        """An executor on all workers; the cluster replaces those that end."""
        executor: Executor = self._client.get_executor(pure=False)
        return executor

    def close(self, executor: Executor, at_once: bool) -> None:
        """Leave the cluster as it is; what is under way is cancelled."""
        executor.shutdown(wait=not at_once)

    def is_kill(self, error: BaseException) -> bool:
        """Whether a task has ended as many workers as the scheduler allows."""
        from distributed.scheduler import KilledWorker

        return isinstance(error, KilledWorker)

    def is_loss(self, error: BaseException) -> bool:
        """Whether the scheduler is gone: the client has cancelled all it had there, or is closed."""
        from distributed.client import ClosedClientError
        from distributed.comm.core import CommClosedError

        return isinstance(error, CancelledError | CommClosedError | ClosedClientError)

    def leave(self) -> None:
        """Leave the cluster; it goes on."""
        self._client.close()
