"""Lends a device to bakes, as a Dask worker: `blender -b -c hemibake_worker tcp://host:8786`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib.util import find_spec

from .signals import Signals, Stopped

_DESCRIPTION = """Lend a device to bakes: a worker of a Dask scheduler, until either is stopped.
One worker takes one block of patches at a time on one device; start as many as there are devices.
Options of `dask worker`, such as --name or --tls-ca-file, go to Dask as they are."""

_NO_DASK = "Workers need the Python package 'distributed' (Dask). Install Hemibake's package with Dask.\n"


def work(arguments: Sequence[str], program: str) -> int:
    """Run a worker until the scheduler ends or the process is stopped; return the exit code."""
    parser = argparse.ArgumentParser(prog=program, description=_DESCRIPTION, allow_abbrev=False)
    parser.add_argument("scheduler", help="address of the scheduler, as tcp://host:8786")
    parser.add_argument("--device", metavar="NAME", help="OpenCL device as Hemibake's preferences name it")
    given, of_dask = parser.parse_known_args(arguments)
    if find_spec("distributed") is None:
        sys.stderr.write(_NO_DASK)
        return 1
    with Signals() as signals:
        return _work(given.scheduler, given.device, of_dask, signals)


def _work(scheduler: str, device: str | None, options: Sequence[str], signals: Signals) -> int:
    """Start a worker process and wait for it; a signal that ends this process ends the worker as well."""
    from ...engine.cluster.local_workers import end_worker, start_worker
    from ...engine.cluster.prepared_scene import DEVICE

    worker = start_worker(scheduler, {DEVICE: device} if device else {}, *options, printed=True)
    try:
        with signals.listening():
            return worker.wait()
    except Stopped as stopped:
        return stopped.code
    finally:
        worker.terminate()
        end_worker(worker)
