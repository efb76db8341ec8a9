"""Workers on this machine: a scheduler, and a process for each OpenCL device."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from distributed import Client, LocalCluster

from ..device.cl_device import device_name, found_devices
from ..device.egl_devices import egl_devices
from ..device.opencl import cl
from ..errors import DeviceError
from .event_loop import event_loop
from .prepared_scene import DEVICE

#: What stands for a worker on each device of this machine, instead of a scheduler's address.
LOCAL = "all"

#: Where scheduler, workers and their pages about tasks listen: other machines do not reach them.
_HERE = "127.0.0.1"

#: What NVIDIA's driver calls its vendor.
_NVIDIA = "NVIDIA"

#: Folder that holds the package `engine`.
_HOME = Path(__file__).resolve().parents[2]

#: Seconds in which a scheduler has to answer, and a worker before it counts as gone.
ANSWER, _GONE = 60, 10

#: Seconds in which a worker has to answer who asks it for results: one that has just died does not. If it is
#: only late they are asked for again, by way of the scheduler.
RESULTS = 3

#: Seconds that workers have to start, and to end.
_START, _FAREWELL = 60.0, 3.0


class LocalWorkers:
    """A scheduler of this process and a worker process for each environment, which `close` ends."""

    def __init__(self, environments: Sequence[Mapping[str, str]]) -> None:
        """Start workers, each with environment variables of its own.

        Raises DeviceError if one does not come.
        """
        self._workers: list[subprocess.Popen[bytes]] = []
        with ExitStack() as opened:
            loop = opened.enter_context(event_loop())
            options = {"dashboard_address": f"{_HERE}:0", "loop": loop}
            self._cluster = opened.enter_context(LocalCluster(n_workers=0, processes=True, **options))
            self._cluster.scheduler.rpc.timeout = RESULTS
            self.client = opened.enter_context(Client(self._cluster, timeout=ANSWER))
            self._opened = opened.pop_all()
        try:
            self._start(environments)
        except BaseException:
            self.close()
            raise

    def _start(self, environments: Sequence[Mapping[str, str]]) -> None:
        """Start workers and wait for them."""
        for environment in environments:
            self.add(environment)
        try:
            self.client.wait_for_workers(len(self._workers), timeout=_START)
        except TimeoutError as error:
            raise DeviceError(
                f"{len(self._workers)} workers did not start within {_START:.0f} s. Bake without a scheduler."
            ) from error

    def add(self, environment: Mapping[str, str]) -> None:
        """Start one more worker."""
        listening = ("--host", _HERE, "--dashboard-address", f"{_HERE}:0")
        self._workers.append(start_worker(self._cluster.scheduler_address, environment, *listening))

    def kill(self, number: int) -> None:
        """End a worker at once, as a crash of its driver would."""
        self._workers[number].kill()

    def close(self) -> None:
        """End the workers and the scheduler."""
        for worker in self._workers:
            worker.terminate()
        self._opened.close()
        deadline = time.monotonic() + _FAREWELL
        for worker in self._workers:
            end_worker(worker, deadline - time.monotonic())


def end_worker(worker: subprocess.Popen[bytes], seconds: float = _FAREWELL) -> None:
    """Wait for a worker that was asked to end; one whose driver does not in time is killed."""
    try:
        worker.wait(max(seconds, 0))
    except subprocess.TimeoutExpired:
        worker.kill()
        worker.wait()


def local_environments() -> list[dict[str, str]]:
    """Return the environment of each worker of this machine, which names its device.

    There is one worker for each graphics card, or a single one without any.

    CUDA_VISIBLE_DEVICES hides the other cards of NVIDIA's driver from OpenCL, but not from OpenGL, which
    takes the device of EGL that GLCONTEXT_DEVICE_INDEX numbers. Other cards are told apart by their OpenCL
    names, as far as these differ.
    """
    cards = [device for device in found_devices() if device.type & cl.device_type.GPU]
    if not cards:
        return [{}]
    if all(_NVIDIA in device.vendor for device in cards):
        drawing = egl_devices()
        return [_nvidia_environment(number, drawing) for number in range(len(cards))]
    return [{DEVICE: name} for name in dict.fromkeys(map(device_name, cards))]


def _nvidia_environment(number: int, drawing: Mapping[int, int]) -> dict[str, str]:
    """Return the environment of a worker that computes and draws on a card of NVIDIA's, by its number.

    drawing: see `egl_devices`
    """
    environment = {"CUDA_VISIBLE_DEVICES": str(number)}
    if number in drawing:
        environment["GLCONTEXT_DEVICE_INDEX"] = str(drawing[number])
    return environment


def start_worker(
    address: str, environment: Mapping[str, str], *options: str, printed: bool = False
) -> subprocess.Popen[bytes]:
    """Start a worker of a scheduler: a process with one thread, and so one block at a time.

    options  further ones of `dask worker`
    printed  True to leave its output to that of this process
    """
    command = [sys.executable, "-P", "-m", "distributed.cli.dask_worker", address, "--nthreads", "1"]
    command += ["--no-dashboard", "--no-nanny", "--memory-limit", "0", *options]
    folders = (str(_HOME), *(path for path in sys.path if path))
    gone = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": f"{_GONE}s"}
    variables = {**os.environ, **gone, "PYTHONPATH": os.pathsep.join(folders), **environment}
    output = None if printed else subprocess.DEVNULL
    return subprocess.Popen(command, env=variables, stdout=output, stderr=output)
