"""Hits that another device traces ahead, and its objects for the gather, after errors."""

from __future__ import annotations

from collections.abc import Generator
from types import SimpleNamespace

import pytest

from engine import Settings
from engine.device.cl_device import ComputeDevice
from engine.device.opencl import cl
from engine.gather import shared_gather
from engine.gather.shared_gather import DeviceParts, DeviceRows
from engine.plan import sharing
from engine.visibility.rays.early_hits import EarlyHits


class _FailingTracer:
    """Tracer on a device that is lost."""

    samples, hit_bytes = 4, 16

    def __init__(self, error: Exception) -> None:
        self._error = error

    def trace_hits(self, *_: object) -> Generator[tuple[int, int], None, None]:
        yield 0, 1
        raise self._error


@pytest.mark.parametrize("error", [cl.MemoryError, cl.RuntimeError, cl.LogicError, ValueError])
def test_piece_without_hits_counts_as_such_after_any_error(
    error: type[Exception], compute: ComputeDevice
) -> None:
    tracer = _FailingTracer(error("OUT_OF_RESOURCES"))
    early = EarlyHits(100, [compute], lambda _: tracer, Settings())
    compute.thread.submit(lambda: None).result()
    (piece,) = early.on(compute)
    assert (piece.hits, piece.first, piece.last) == (None, early.stop(), 100)
    compute.thread.end()


def test_error_while_another_device_prepares_is_raised_by_its_gather(
    compute: ComputeDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise cl.MemoryError("OUT_OF_RESOURCES")

    monkeypatch.setattr(shared_gather, "GatherKernels", fail)
    parts = DeviceParts(SimpleNamespace(count=8, sampling=None), None, None, 8)
    rows = DeviceRows(compute, lambda: parts)
    rows.begin()
    compute.thread.submit(lambda: None).result()
    compute.thread.end()
    with pytest.raises(cl.MemoryError):
        _ = rows.cache


@pytest.mark.parametrize(("texels", "fit"), [((1 << 31) - 1, True), (1 << 31, False)])
def test_last_texel_is_no_hit_of_the_sky(texels: int, fit: bool, compute: ComputeDevice) -> None:
    patch_scene = SimpleNamespace(
        texel_to_patch=SimpleNamespace(size=texels), cutouts=SimpleNamespace(tinted=False)
    )
    settings = Settings(adaptive=False)
    assert sharing._traces_early(SimpleNamespace(compute=compute), patch_scene, settings) == fit
