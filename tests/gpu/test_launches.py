"""What `benchmarks.launches` lists of a bake, and the number of launches of a small one."""

import numpy as np
import pyopencl as cl
import pytest

from benchmarks.device_log import COPY, DOWNLOAD, FILL, LAUNCH, UPLOAD, DeviceLog
from benchmarks.launches import WORK, by_caller, by_kernel, by_stage, report
from engine import Settings, finished
from engine.device.buffers import download, upload, zeros
from engine.device.cl_device import ComputeDevice
from engine.session import Session
from tests.analytic.scenes import nine_quad_room
from tests.gpu.slice_sizes import fix_slice_size

SETTINGS = Settings(
    resolution=67,
    visibility="rays",
    samples=32,
    max_bounces=3,
    tolerance=0,
    light_samples=4,
    intermediates=False,
)

#: Most launches of a warm bake of these settings in slices of all patches. Measured: 175 and 133 on a CPU,
#: where each scale of the fill is a launch; 145 and 89 on a GPU, where one launch fills all small scales.
MOST = {"CPU": {"U": 176, "G": 134}, "GPU": {"U": 162, "G": 102}}


def test_a_log_has_every_command_with_its_bytes():
    log = DeviceLog()
    with log.logging():
        compute = ComputeDevice()
        log.clear()
        buffer = upload(compute, np.arange(37, dtype=np.float32))
        filled = zeros(compute, 44)
        cl.enqueue_copy(compute.queue, filled, buffer, byte_count=40)
        (to_float4,) = compute.kernels("float4_rows.cl", "to_float4")
        wide = zeros(compute, 16 * 12)
        compute.run(to_float4, 12, buffer, wide, np.int32(0), np.int32(12), np.int32(12))
        assert download(compute, wide, (12, 4))[3, 1] == 10
        log.end()
    kinds = [(entry.kind, entry.size) for entry in log.entries]
    assert kinds == [(UPLOAD, 148), (FILL, 44), (COPY, 40), (FILL, 192), (LAUNCH, 0), (DOWNLOAD, 192)]
    assert log.entries[4].name == "to_float4" and log.entries[4].device_seconds > 0
    assert sum(log.seconds.values()) > 0
    table = by_stage(log.entries, log.seconds)
    assert table.splitlines()[-1].split("|")[3].strip() == "1"
    assert "to_float4" in by_kernel(log.entries) and "test_launches" in by_caller(log.entries)


def test_nothing_is_logged_afterwards():
    log = DeviceLog()
    with log.logging():
        pass
    upload(ComputeDevice(), np.ones(5, np.float32))
    assert log.entries == []


def test_passes_of_numpy_have_the_function_that_asked_for_them():
    log, values = DeviceLog(), np.random.default_rng(0).random(2_000_003)
    with log.passes():
        np.sort(values)
        np.nonzero(values)
    assert any("sort in " in entry.name for entry in log.entries)
    assert all(entry.seconds >= 20e-6 for entry in log.entries)


@pytest.mark.parametrize("work", WORK)
def test_a_small_bake_starts_no_more_kernels_than_before(monkeypatch, work):
    """Each launch costs a card 40 us: a new one has to be worth it."""
    fix_slice_size(monkeypatch, 1 << 20)
    settings = Settings(**(vars(SETTINGS) | WORK[work]))
    log, session = DeviceLog(), Session()
    with log.logging():
        counts = []
        for _ in range(2):
            session.forget()
            log.clear()
            finished(session.bake(nine_quad_room(), settings))
            log.end()
            counts.append(sum(entry.kind == LAUNCH for entry in log.entries))
        session.close()
    assert counts[0] == counts[1] <= MOST["CPU" if ComputeDevice().processor else "GPU"][work]
    assert f"{counts[1]} launches" in report(log, listed=True)
