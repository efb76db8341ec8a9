"""Compares the memory bandwidth of the gather kernel with the bandwidth of a copy on the device."""

from __future__ import annotations

import time
from itertools import product
from typing import Any

import pyopencl as cl

from benchmarks.gather_rate import gather_bytes_per_second
from benchmarks.options import Options
from benchmarks.tables import table
from engine.device.cl_device import ComputeDevice

_REPEATS = 10


def run(options: Options) -> list[dict[str, Any]]:
    """Time copies from buffer to buffer, then the gather kernel."""
    compute = ComputeDevice()
    copied = copy_bytes_per_second(compute, (1 << 30) if options.gpu else (256 << 20))
    records = []
    hemicubes = [{"visibility": "rays", "directions": "hemicube", "hemicube": n} for n in (32, 64)]
    ways = [*hemicubes, *({"visibility": "rays", "samples": n} for n in (256, 1024))]
    for resolution, values in product((128, 512) if options.gpu else (128,), ways):
        rate = gather_bytes_per_second(values, resolution)
        records.append(
            {"copy_bytes_per_second": copied, **rate, "fraction": rate["bytes_per_second"] / copied}
        )
    return records


def tables(records: list[dict[str, Any]], options: Options) -> str:
    """Return rates in GB/s."""
    rows = [
        (
            record["samples"], record["patches"], record["bytes"] / 1e9, 1e3 * record["seconds"],
            1e3 * record["iteration_seconds"], record["bytes_per_second"] / 1e9,
            record["copy_bytes_per_second"] / 1e9, f"{record['fraction']:.0%}",
        )
        for record in records
    ]  # fmt: skip
    titles = (
        "samples", "patches", "indices, GB", "kernel, ms", "iteration, ms", "kernel, GB/s", "copy, GB/s",
        "kernel / copy",
    )  # fmt: skip
    return table(titles, rows)


def copy_bytes_per_second(compute: ComputeDevice, size: int) -> float:
    """Return how many bytes a second the best copy between buffers of `size` bytes reads and writes."""
    flags = cl.mem_flags.READ_WRITE
    source, target = (cl.Buffer(compute.context, flags, size) for _ in range(2))
    cl.enqueue_fill_buffer(compute.queue, source, b"\x01", 0, size)
    seconds = []
    for _ in range(_REPEATS):
        compute.queue.finish()
        started = time.perf_counter()
        cl.enqueue_copy(compute.queue, target, source, byte_count=size)
        compute.queue.finish()
        seconds.append(time.perf_counter() - started)
    source.release()
    target.release()
    return 2 * size / min(seconds)
