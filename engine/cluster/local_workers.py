"""Local Dask cluster: a scheduler, and one worker process per OpenCL device of this machine."""

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

#: Address of scheduler, workers and dashboards, not reachable from other machines.
_HERE = "127.0.0.1"

#: Vendor name of NVIDIA's OpenCL driver.
_NVIDIA = "NVIDIA"

#: Folder that contains the package `engine`; module search path of the workers.
_HOME = Path(__file__).resolve().parents[2]

#: Seconds in which a scheduler must answer, and after which a silent worker counts as lost.
ANSWER, _GONE = 60, 10

#: Timeout in seconds for a worker's reply to a request for results; after it, the scheduler is asked.
RESULTS = 3

#: Seconds allowed for workers to start, and to end.
_START, _FAREWELL = 60.0, 3.0


class LocalWorkers:
    """Scheduler in this process with one worker process per environment; `close` ends both."""

    def __init__(self, environments: Sequence[Mapping[str, str]]) -> None:
        """Start workers, each with its own environment variables.

        Raises DeviceError if one does not start.
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
        """Start the workers and wait for them."""
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
        """Kill a worker at once, like a driver crash; for tests."""
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
    """Wait for a worker that was asked to end; kill it after a timeout."""
    try:
        worker.wait(max(seconds, 0))
    except subprocess.TimeoutExpired:
        worker.kill()
        worker.wait()


def local_environments() -> list[dict[str, str]]:
    """Return the environment variables of each worker of this machine, which select its device.

    There is one worker per GPU, or a single worker if there is none.

    CUDA_VISIBLE_DEVICES hides other NVIDIA GPUs from OpenCL, but not from OpenGL, whose EGL device
    GLCONTEXT_DEVICE_INDEX selects. Other GPUs are selected by OpenCL device name, as far as names differ.
    """
    cards = [device for device in found_devices() if device.type & cl.device_type.GPU]
    if not cards:
        return [{}]
    if all(_NVIDIA in device.vendor for device in cards):
        drawing = egl_devices()
        return [_nvidia_environment(number, drawing) for number in range(len(cards))]
    return [{DEVICE: name} for name in dict.fromkeys(map(device_name, cards))]


def _nvidia_environment(number: int, drawing: Mapping[int, int]) -> dict[str, str]:
    """Return the environment of a worker that computes and draws on NVIDIA GPU `number`.

    drawing: EGL device of each GPU, see `egl_devices`
    """
    environment = {"CUDA_VISIBLE_DEVICES": str(number)}
    if number in drawing:
        environment["GLCONTEXT_DEVICE_INDEX"] = str(drawing[number])
    return environment


def start_worker(
    address: str, environment: Mapping[str, str], *options: str, printed: bool = False
) -> subprocess.Popen[bytes]:
    """Start a worker process of a scheduler, with one thread, so one block at a time.

    options:  further options of `dask worker`
    printed:  True to show its output on this process's output
    """
    command = [sys.executable, "-P", "-m", "distributed.cli.dask_worker", address, "--nthreads", "1"]
    command += ["--no-dashboard", "--no-nanny", "--memory-limit", "0", *options]
    folders = (str(_HOME), *(path for path in sys.path if path))
    gone = {"DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": f"{_GONE}s"}
    variables = {**os.environ, **gone, "PYTHONPATH": os.pathsep.join(folders), **environment}
    output = None if printed else subprocess.DEVNULL
    return subprocess.Popen(command, env=variables, stdout=output, stderr=output)
