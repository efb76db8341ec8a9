"""Tasks for the workers of a scheduler: how they begin, how their results come back, how they fail."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

import dask
import numpy as np
from distributed import Client, Future, wait
from distributed.client import ClosedClientError
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker

from ..errors import DeviceError
from .blocks import Span

#: A bake that waits for workers can be cancelled this often, s.
_PAUSE = 0.2

#: It ends with an error once there have been none for this time, s.
_PATIENCE = 20.0

#: Dask warns of tasks with large arguments; here the scheduler shall keep them, to repeat the tasks.
_LARGE_GRAPH = "distributed.admin.large-graph-warning-threshold"


class Tasks:
    """Begins tasks and takes their results.

    All methods raise DeviceError if the scheduler is gone, or a task ends every worker that takes it.
    """

    def __init__(self, client: Client) -> None:
        self._client, self._address = client, str(client.scheduler.address)

    @property
    def dashboard(self) -> str:
        """Address of the page on which the tasks can be watched."""
        return str(self._client.dashboard_link)

    def workers(self) -> set[str]:
        """Return the addresses of the workers that are there."""
        with self._losses_told():
            return set(self._client.scheduler_info(n_workers=-1)["workers"])

    def begin(self, function: Callable, *arguments: object, worker: str | None = None) -> Future:
        """Have a worker do a task; the same one begun again is another task.

        worker: the address of the one that shall do it as long as it is there; None for any
        """
        where: dict[str, Any] = {"workers": [worker], "allow_other_workers": True} if worker else {}
        with self._losses_told(), dask.config.set({_LARGE_GRAPH: "1 PiB"}):
            return self._client.submit(function, *arguments, pure=False, **where)

    def sent(self, value: object) -> Future:
        """Return a value as the result of a task, which workers fetch from each other.

        The scheduler keeps it as the argument of the task, so that it can give it to a worker again.
        """
        return self.begin(_given, value)

    def rows(self, tasks: dict[Future, Span]) -> Generator[float, None, np.ndarray]:
        """Return the rows that tasks make, one after another; yield the fraction done.

        tasks: with the first row of each and the one after its last
        """
        count = max(last for _, last in tasks.values())
        rows: list[np.ndarray] = []

        def put(span: Span, part: np.ndarray) -> None:
            if not rows:
                rows.append(np.empty((count, *part.shape[1:]), part.dtype))
            rows[0][slice(*span)] = part

        yield from self.take(tasks, put)
        return rows[0]

    def take(
        self, tasks: dict[Future, Span], put: Callable[[Span, Any], None]
    ) -> Generator[float, None, None]:
        """Put away the result of each task as it ends, with its span; yield the fraction done.

        Raises DeviceError without workers.
        """
        left, lost = set(tasks), 0.0
        while left:
            with self._losses_told():
                ended, left = _ended(left)
                results = self._client.gather(ended, direct=True)
                lost = 0.0 if ended or self._has_workers() else lost + _PAUSE
            if lost > _PATIENCE:
                raise DeviceError(
                    f"The scheduler at {self._address} has had no workers for {_PATIENCE:.0f} s. "
                    "Start some with tools/worker.py, then bake again."
                )
            for task, result in zip(ended, results, strict=True):
                put(tasks[task], result)
            yield 1 - len(left) / len(tasks)

    def _has_workers(self) -> bool:
        """Return whether any worker is there; raises OSError if the scheduler is gone."""
        if self._client.status == "connecting":
            return False
        if self._client.status != "running":
            raise OSError("the connection is lost")
        return bool(self._client.scheduler_info(n_workers=1)["workers"])

    @contextmanager
    def _losses_told(self) -> Iterator[None]:
        """Turn what Dask raises if something is lost into a DeviceError."""
        try:
            yield
        except KilledWorker as error:
            raise DeviceError(
                f"Workers died again and again while they found what a block of patches sees ({error}). "
                "Their logs tell why; less memory is needed with Patch Groups or fewer samples."
            ) from error
        except (ClosedClientError, CommClosedError, CancelledError, TimeoutError, OSError) as error:
            why = "the connection was lost" if isinstance(error, CancelledError) else error
            raise DeviceError(
                f"The Dask scheduler at {self._address} cannot be reached any more ({why}). Start it again, "
                "then bake again."
            ) from error


def _ended(tasks: set[Future]) -> tuple[list[Future], set[Future]]:
    """Wait a moment for any task to end; return those that have, and the others."""
    try:
        ended, left = wait(tasks, timeout=_PAUSE, return_when="FIRST_COMPLETED")
    except TimeoutError:
        return [], tasks
    return list(ended), left


def _given(value: object) -> object:
    """Return what is given."""
    return value
