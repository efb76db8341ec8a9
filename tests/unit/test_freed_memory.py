"""Memory freed by a bake stays with the worker until it is idle."""

import subprocess
import sys
from pathlib import Path

import pytest

from engine.device import freed_memory

_SCRIPT = """
import resource
import numpy as np
from engine.device.freed_memory import give_back_freed_memory, keep_freed_memory

def resident():
    with open("/proc/self/statm") as pages:
        return int(pages.read().split()[1]) * resource.getpagesize() >> 20

def bake():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for size in (7, 61, 13):
        np.ones(size << 20, np.uint8)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

keep_freed_memory()
start, first, second, kept = resident(), bake(), bake(), resident()
give_back_freed_memory()
print(first, second, kept - start, resident() - start)
"""


@pytest.mark.skipif(freed_memory._glibc() is None, reason="another C library")
def test_the_next_bake_maps_no_pages_and_an_idle_process_has_none():
    root = Path(__file__).parents[2]
    found = subprocess.run(
        [sys.executable, "-c", _SCRIPT], cwd=root, capture_output=True, text=True, check=True
    )
    first, second, kept, idle = map(int, found.stdout.split())
    assert first > 500 and second < first / 20
    assert kept > 50 and idle < 10
