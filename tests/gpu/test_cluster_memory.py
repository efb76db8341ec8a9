"""Workers that do not see the memory of the client's machine, as in containers: by a namespace of mounts."""

import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine import Settings
from engine.cluster import local_workers
from engine.cluster.machine_files import file_bytes
from engine.cluster.memory_folder import file_with, memory_folder
from engine.cluster.radiance_exchange import RadianceExchange, write_rows
from engine.errors import DeviceError
from engine.gather.half_radiance import HalfRadiance
from engine.progress import finished
from engine.session import Session
from tests.analytic.scenes import nine_quad_room
from tests.gpu.schedulers import ONE_THREAD

#: Runs a command with an empty /dev/shm of its own.
APART = ("unshare", "-rm", "sh", "-c", 'mount -t tmpfs none /dev/shm && exec "$@"', "sh")


def _is_possible():
    return shutil.which(APART[0]) and not subprocess.run([*APART, "true"], capture_output=True).returncode


pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not _is_possible(), reason="This user may not have a /dev/shm of its own."),
]

SETTINGS = Settings(
    resolution=45, samples=64, visibility="rays", texel_samples=4, patch_groups=2, intermediates=False
)


@pytest.fixture
def apart(monkeypatch, tmp_path):
    """Return a function that starts a cluster worker with separate memory, and waits for it."""
    command = tmp_path / "python"
    words = " ".join(f"'{word}'" for word in (*APART, sys.executable))
    command.write_text(f'#!/bin/sh\nexec {words} "$@"\n')
    command.chmod(0o755)

    def add(made, count):
        with monkeypatch.context() as patched:
            patched.setattr(local_workers.sys, "executable", str(command))
            made.add(ONE_THREAD)
        made.client.wait_for_workers(count, timeout=60)

    return add


@contextmanager
def cluster(count):
    made = local_workers.LocalWorkers([ONE_THREAD] * count)
    try:
        yield made
    finally:
        made.close()


def test_a_worker_of_other_memory_that_joins_is_used(apart):
    """It receives scene, patches and light, and sends its rows, though the bake started with shared files.

    Which tasks it gets is Dask's choice, so any task of the bake will do.
    """
    with cluster(1) as made:
        address = made.client.scheduler_info()["address"]
        settings = replace(SETTINGS, scheduler=address)
        wanted = finished(Session().bake(nine_quad_room(), settings))
        work = Session().bake(nine_quad_room(), settings)
        next(work)
        before = set(made.client.scheduler_info(n_workers=-1)["workers"])
        apart(made, 2)
        made.client.get_task_stream(count=0)
        began = time.time()
        assert np.array_equal(finished(work).display, wanted.display)
        (joined,) = set(made.client.scheduler_info(n_workers=-1)["workers"]) - before
        done = made.client.get_task_stream(start=began)
    kinds = {task["key"].split("-")[0] for task in done if task["worker"] == joined}
    assert kinds & {"sampled", "find", "gather_to", "final"}


def test_bakes_that_begin_with_such_a_worker_need_no_files(apart):
    with cluster(1) as made:
        settings = replace(SETTINGS, scheduler=made.client.scheduler_info()["address"])
        wanted = finished(Session().bake(nine_quad_room(), settings))
        apart(made, 2)
        assert np.array_equal(finished(Session().bake(nine_quad_room(), settings)).display, wanted.display)


def test_contents_travel_through_those_who_see_them(apart):
    count = 10007
    light = np.arange(3 * count, dtype=np.float16).reshape(count, 3)
    with memory_folder() as folder, cluster(1) as made:
        path, memory = file_with(folder, b"\0scene"), RadianceExchange(folder, count)
        sent = memory.put(HalfRadiance(light, np.float32(3)))
        apart(made, 2)
        (joined,) = (worker for worker, sees in made.client.run(_sees, folder).items() if not sees)

        def on_joined(function, *arguments):
            return made.client.submit(function, *arguments, workers=[joined], pure=False).result()

        assert on_joined(file_bytes, path) == b"\0scene"
        arrived = on_joined(sent.__class__.opened, sent)
        assert arrived.parts.tobytes() == light.tobytes() and arrived.unit == 3
        on_joined(write_rows, memory.path, 5003, np.full((4999, 3), 7, np.float32), count)
        assert not memory.rows[:5003].any() and not memory.rows[10002:].any()
        assert (memory.rows[5003:10002] == 7).all()
        made.kill(0)
        with pytest.raises(DeviceError, match="shares no memory with the machine.*Bake again"):
            on_joined(file_bytes, path)


def _sees(folder):
    """Return whether this worker sees a folder."""
    return Path(folder).exists()
