"""Lends a device to bakes: a Dask worker of a scheduler.

    python tools/worker.py tcp://host:8786 [--device "PLATFORM: DEVICE"] [options of `dask worker`]

The options are those of `blender -c hemibake_worker`, from the same code.
"""

from __future__ import annotations

import sys

from headless import load

if __name__ == "__main__":
    sys.exit(load("operators.command_line.worker").work(sys.argv[1:], "worker.py"))
