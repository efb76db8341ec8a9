"""Tasks for the workers of a scheduler: how they begin, how their results come back, how they fail.

The scheduler unpickles what it is sent, and has no Hemibake: functions and values are bytes to it, which a
worker unpickles in tasks of their own.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any

import dask
import numpy as np
from dask.utils import apply
from distributed import Client, Future, wait
from distributed.client import ClosedClientError
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker

from ..errors import DeviceError
from ..numpy_pickle import portable_bytes
from .blocks import Span

#: A bake that waits for workers can be cancelled this often, s.
_PAUSE = 0.2

#: It ends with an error once there have been none for this time, s.
_PATIENCE = 20.0

#: Dask warns of tasks with large arguments; here the scheduler shall keep them, to repeat the tasks.
_LARGE_GRAPH = "distributed.admin.large-graph-warning-threshold"

#: Tasks that the client waits for are done before those that only begin early.
URGENT, EARLY = 1, 0


class Tasks:
    """Begins tasks and takes their results, which nobody makes again once they are taken.

    All methods raise DeviceError if the scheduler is gone, or a task ends every worker that takes it.
    """

    def __init__(self, client: Client) -> None:
        self._client, self._address = client, str(client.scheduler.address)
        self._functions: dict[Callable, Future] = {}

    @property
    def dashboard(self) -> str:
        """Address of the page on which the tasks can be watched."""
        return str(self._client.dashboard_link)

    def workers(self) -> set[str]:
        """Return the addresses of the workers that are there."""
        with self._losses_told():
            return set(self._client.scheduler_info(n_workers=-1)["workers"])

    def begin(
        self,
        function: Callable,
        arguments: Iterable[Sequence[object]],
        priority: int = URGENT,
        worker: str | None = None,
    ) -> list[Future]:
        """Have workers call a function with each of some arguments; begun again, these are other tasks.

        arguments  futures, whose results are taken, and what is small and of Python itself
        worker     address of the one that calls it unless it is lost; None for any
        """
        calls = [list(values) for values in arguments]
        called = [self._function(function)] * len(calls)
        where: dict[str, Any] = {"workers": [worker], "allow_other_workers": True} if worker else {}
        options = {"key": function.__name__, "pure": False, "priority": priority, **where}
        with self._losses_told():
            return list(self._client.map(apply, called, calls, **options))

    def sent(self, value: object, name: str) -> Future:
        """Return a value as the result of a task, which workers fetch from each other.

        The scheduler keeps it as the argument of the task, so that it can give it to a worker again.

        name: of values of this kind. A worker gets tasks as it has done others, not all of its part at once,
        where these need few values; Dask counts all of a name.
        """
        options = {"key": name, "pure": False, "priority": URGENT}
        with self._losses_told(), dask.config.set({_LARGE_GRAPH: "1 PiB"}):
            return self._client.map(pickle.loads, [portable_bytes(value)], **options)[0]

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
        done = 0
        for ended in self._ended(tasks, "FIRST_COMPLETED"):
            with self._losses_told():
                results = self._client.gather(ended, direct=True)
            for task, result in zip(ended, results, strict=True):
                put(tasks[task], result)
                task.release()
            done += len(ended)
            yield done / len(tasks)

    def finish(self, tasks: Sequence[Future]) -> Generator[float, None, None]:
        """Wait for tasks whose results nobody needs; yield the fraction done. Errors as of `take`."""
        done = 0
        for ended in self._ended(tasks, "ALL_COMPLETED"):
            for task in ended:
                if task.status != "finished":
                    with self._losses_told():
                        task.result()
                task.release()
            done += len(ended)
            yield done / len(tasks)

    def _ended(self, tasks: Iterable[Future], until: str) -> Iterator[list[Future]]:
        """Yield the tasks that have ended since the last time, perhaps none, until there are no others.

        until: what is waited for each time, if it does not take too long
        """
        left, lost = set(tasks), 0.0
        while left:
            with self._losses_told():
                ended = _wait(left, until)
                lost = 0.0 if ended or self._has_workers() else lost + _PAUSE
            if lost > _PATIENCE:
                raise DeviceError(
                    f"The scheduler at {self._address} has had no workers for {_PATIENCE:.0f} s. "
                    "Start some with tools/worker.py, then bake again."
                )
            left.difference_update(ended)
            yield ended

    def _function(self, function: Callable) -> Future:
        """Return a function as the result of a task."""
        if function not in self._functions:
            self._functions[function] = self.sent(function, f"{function.__name__}_function")
        return self._functions[function]

    def _has_workers(self) -> bool:
        """Return whether any worker is there; raises OSError if the scheduler is gone."""
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
                "Their logs tell why; less memory is needed with Texel Groups or fewer samples."
            ) from error
        except (ClosedClientError, CommClosedError, CancelledError, TimeoutError, OSError) as error:
            why = "the connection was lost" if isinstance(error, CancelledError) else error
            raise DeviceError(
                f"The Dask scheduler at {self._address} cannot be reached any more ({why}). Start it again, "
                "then bake again."
            ) from error


def _wait(tasks: set[Future], until: str) -> list[Future]:
    """Wait a moment for tasks to end; return those that have."""
    try:
        return list(wait(tasks, timeout=_PAUSE, return_when=until).done)
    except TimeoutError as error:
        _forget_traceback(error)
        return [task for task in tasks if task.done()]


def _forget_traceback(error: BaseException | None) -> None:
    """Forget which functions an error and its causes came through.

    They hold the tasks and, in a cycle, the error: the tasks would live until garbage is collected.
    """
    while error:
        error.__traceback__ = None
        error = error.__cause__ or error.__context__
