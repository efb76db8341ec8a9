"""Lend a device to bakes: a Dask worker of a scheduler.

    python tools/worker.py tcp://host:8786 [--device "PLATFORM: DEVICE"] [options of `dask worker`]

One worker takes one block of patches at a time on one device; start as many as there are devices.
Options such as --tls-ca-file go to Dask as they are.
"""

from __future__ import annotations

import argparse
import sys

from headless import load

local_workers = load("engine.cluster.local_workers")


def main(arguments: list[str]) -> int:
    """Work until the scheduler ends or the process is stopped; return the exit code."""
    parser = argparse.ArgumentParser(prog="worker.py", description=__doc__.splitlines()[0])
    parser.add_argument("scheduler", help="address of the scheduler")
    parser.add_argument("--device", metavar="NAME", help="OpenCL device as Hemibake's preferences name it")
    given, of_dask = parser.parse_known_args(arguments)
    environment = {local_workers.DEVICE: given.device} if given.device else {}
    return local_workers.start_worker(given.scheduler, environment, *of_dask, printed=True).wait()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
