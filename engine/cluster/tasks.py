"""Dask tasks: submission, results and failures.

The scheduler unpickles what it receives, but has no Hemibake. Functions and values are therefore sent as
bytes, which workers unpickle in separate tasks.
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

#: Polling interval while waiting for workers, s; a bake can be cancelled at this rate.
_PAUSE = 0.2

#: Seconds without any worker after which a bake ends with an error.
_PATIENCE = 20.0

#: Limit above which Dask warns of tasks with large arguments. Here the scheduler must keep them, to repeat
#: tasks.
_LARGE_GRAPH = "distributed.admin.large-graph-warning-threshold"

#: Priorities of tasks that the client waits for, and of tasks started early.
URGENT, EARLY = 1, 0


class Tasks:
    """Starts tasks and takes their results, which are released once taken.

    All methods raise DeviceError if the scheduler is lost, or a task kills every worker that runs it.
    """

    def __init__(self, client: Client) -> None:
        self._client, self._address = client, str(client.scheduler.address)
        self._functions: dict[Callable, Future] = {}

    @property
    def dashboard(self) -> str:
        """Address of the scheduler's dashboard."""
        return str(self._client.dashboard_link)

    def workers(self) -> set[str]:
        """Return the addresses of the present workers."""
        with self._translated_losses():
            return set(self._client.scheduler_info(n_workers=-1)["workers"])

    def begin(
        self,
        function: Callable,
        arguments: Iterable[Sequence[object]],
        priority: int = URGENT,
        worker: str | None = None,
    ) -> list[Future]:
        """Start a task for each tuple of arguments; repeated calls create new tasks.

        arguments:  futures, whose results are passed, and small built-in values
        worker:     address of the preferred worker; None for any
        """
        calls = [list(values) for values in arguments]
        called = [self._function(function)] * len(calls)
        where: dict[str, Any] = {"workers": [worker], "allow_other_workers": True} if worker else {}
        options = {"key": function.__name__, "pure": False, "priority": priority, **where}
        with self._translated_losses():
            return list(self._client.map(apply, called, calls, **options))

    def sent(self, value: object, name: str) -> Future:
        """Send a value; return it as the result of a task, which workers fetch from each other.

        The scheduler keeps the value as the task's argument, so it can send it again.

        name: kind of the value. Dask assigns tasks in steps, as workers finish others, only if the tasks
            depend on few kinds of values; it counts kinds by name.
        """
        options = {"key": name, "pure": False, "priority": URGENT}
        with self._translated_losses(), dask.config.set({_LARGE_GRAPH: "1 PiB"}):
            return self._client.map(pickle.loads, [portable_bytes(value)], **options)[0]

    def rows(self, tasks: dict[Future, Span]) -> Generator[float, None, np.ndarray]:
        """Return the concatenated rows of tasks; yield progress 0..1.

        tasks: span of each task, its first row and its end
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
        """Pass the result of each finished task to `put`, with its span; yield progress 0..1.

        Raises DeviceError without workers.
        """
        done = 0
        for ended in self._ended(tasks, "FIRST_COMPLETED"):
            with self._translated_losses():
                results = self._client.gather(ended, direct=True)
            for task, result in zip(ended, results, strict=True):
                put(tasks[task], result)
                task.release()
            done += len(ended)
            yield done / len(tasks)

    def finish(self, tasks: Sequence[Future]) -> Generator[float, None, None]:
        """Wait for tasks that return nothing; yield progress 0..1. Errors as in `take`."""
        done = 0
        for ended in self._ended(tasks, "ALL_COMPLETED"):
            for task in ended:
                if task.status != "finished":
                    with self._translated_losses():
                        task.result()
                task.release()
            done += len(ended)
            yield done / len(tasks)

    def _ended(self, tasks: Iterable[Future], until: str) -> Iterator[list[Future]]:
        """Yield the tasks that have finished since the last yield, perhaps none, until all have finished.

        until: condition for an early return from each wait
        """
        left, lost = set(tasks), 0.0
        while left:
            with self._translated_losses():
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
        """Send a function to the workers; return it as the result of a Dask task, for other tasks to call."""
        if function not in self._functions:
            self._functions[function] = self.sent(function, f"{function.__name__}_function")
        return self._functions[function]

    def _has_workers(self) -> bool:
        """Return True if any worker is present; raises OSError if the scheduler is lost."""
        if self._client.status != "running":
            raise OSError("the connection is lost")
        return bool(self._client.scheduler_info(n_workers=1)["workers"])

    @contextmanager
    def _translated_losses(self) -> Iterator[None]:
        """Convert errors of Dask about lost connections and workers to DeviceError."""
        try:
            yield
        except KilledWorker as error:
            raise DeviceError(
                f"Workers died repeatedly while they computed the visibility of a block of texels ({error}). "
                "Read their logs. To use less memory, enable Texel Groups or lower the number of samples."
            ) from error
        except (ClosedClientError, CommClosedError, CancelledError, TimeoutError, OSError) as error:
            why = "the connection was lost" if isinstance(error, CancelledError) else error
            raise DeviceError(
                f"The Dask scheduler at {self._address} cannot be reached any more ({why}). Start it again, "
                "then bake again."
            ) from error


def _wait(tasks: set[Future], until: str) -> list[Future]:
    """Wait briefly for tasks; return the tasks that have finished."""
    try:
        return list(wait(tasks, timeout=_PAUSE, return_when=until).done)
    except TimeoutError as error:
        _forget_traceback(error)
        return [task for task in tasks if task.done()]


def _forget_traceback(error: BaseException | None) -> None:
    """Remove tracebacks from an error and its causes.

    Tracebacks refer to the tasks and, in a cycle, to the error, so tasks would live until garbage collection.
    """
    while error:
        error.__traceback__ = None
        error = error.__cause__ or error.__context__
