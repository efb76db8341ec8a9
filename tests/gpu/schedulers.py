"""A Dask scheduler that is a process of its own, as those of farms are."""

import json
import subprocess
import sys
import time
from contextlib import contextmanager

from engine.cluster import local_workers

#: Half of the two processors that tests are sure of.
ONE_THREAD = {"POCL_MAX_PTHREAD_COUNT": "1"}

#: Seconds that a scheduler has to start.
PATIENCE = 60


@contextmanager
def running_scheduler(folder, *options, scheme="tcp"):
    """Yield the address of a scheduler with one worker, and its process; `options` are of both.

    The scheduler is started in the folder: it cannot import Hemibake, as those of others.
    """
    told = folder / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", f"{scheme}://127.0.0.1"]
    command += ["--port", "0", "--no-dashboard", "--scheduler-file", str(told), *options]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes = [subprocess.Popen(command, cwd=folder, **silent)]
    try:
        address = _address_in(told)
        processes.append(local_workers.start_worker(address, ONE_THREAD, *options))
        yield address, processes[0]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _address_in(told):
    """Return the address in a file that a scheduler writes once it listens."""
    for _ in range(10 * PATIENCE):
        try:
            return json.loads(told.read_text())["address"]
        except (OSError, ValueError):
            time.sleep(0.1)
    raise TimeoutError(told)
