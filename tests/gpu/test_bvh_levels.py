"""Wide nodes of a hierarchy are the same however many levels one work group opens at once."""

import numpy as np
import pytest

from engine.device.buffers import download
from engine.visibility.rays import bvh
from engine.visibility.rays.bvh import build_bvh


def triangles(kind: str) -> np.ndarray:
    """Return triangles, (t, 3, 3) float32, whose tree is small, large or deep."""
    random = np.random.default_rng(11)
    if kind == "one":
        return random.random((1, 3, 3)).astype(np.float32)
    if kind == "deep":
        # Each is three times as far as the one before, so that none parts from more than the rest.
        corners = 3.0 ** -np.arange(70)[:, None, None] * (1 + 0.1 * random.random((70, 3, 3)))
        return corners.astype(np.float32)
    centres = random.random((4507, 1, 3)) + np.array([400.0, -30.0, 7.0])
    return (centres + 0.01 * random.random((4507, 3, 3))).astype(np.float32)


def built(compute, monkeypatch, positions, small, room):
    """Return nodes, packets and sizes of a hierarchy, without the unused end of records."""
    monkeypatch.setattr(bvh, "_SMALL", small)
    monkeypatch.setattr(bvh, "_small_limit", lambda compute: small)
    monkeypatch.setattr(bvh, "_ROOM", room)
    made = build_bvh(compute, positions, float(np.abs(positions).max()))
    nodes, packets = (
        download(compute, part, (part.size // 4,)).view(np.uint32) for part in (made.nodes, made.triangles)
    )
    if bvh.shape_for(compute).packet == 1:
        packets = packets.reshape(-1, 12)[:, :10]
    return nodes, packets, made.levels, made.stack, made.options


@pytest.mark.parametrize("kind", ["one", "deep", "many"])
def test_levels_that_are_opened_at_once_have_the_same_nodes(compute, monkeypatch, kind):
    positions = triangles(kind)
    nodes, packets, *sizes = built(compute, monkeypatch, positions, 0, 32)
    for small, room in ((1, 32), (7, 64), (50, 96), (1024, 1 << 15)):
        others = built(compute, monkeypatch, positions, small, room)
        assert np.array_equal(others[0], nodes) and np.array_equal(others[1], packets)
        assert list(others[2:]) == sizes


def test_cpus_open_each_level_by_itself(compute):
    """Since PoCL 7.1 compiles the kernel that opens several levels to code that crashes."""
    assert bvh._small_limit(compute) == (0 if compute.processor else bvh._SMALL)
