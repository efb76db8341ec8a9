"""Blocks of light probes in checkpoints: all values of an interrupted bake, for the same light only."""

import numpy as np
import pytest

from engine.probes.probe_blocks import ProbeBlocks
from engine.resume import checkpoint
from engine.resume.checkpoint import Checkpoints

RANDOM = np.random.default_rng(4)

#: First probe and end of the blocks of a volume of prime size.
SPANS = ((0, 5), (5, 11), (11, 13))


def part(count, maps):
    """Return the values of probes."""
    shape = (count if maps else 0, 8, 8, 2)
    light, distances = RANDOM.random((count, 3, 9, 3), np.float32), RANDOM.random(shape, np.float32)
    return light, RANDOM.random(count, np.float32), RANDOM.random((count, 3)), distances


@pytest.fixture
def opened(tmp_path, monkeypatch):
    """Return a function that opens the blocks of a bake, with the checkpoint it restores them from."""
    monkeypatch.setattr(checkpoint, "_PART", 1000)

    def open_blocks(light="light", limit=1 << 20):
        shared = Checkpoints(str(tmp_path), limit)
        return ProbeBlocks(shared.of(lambda: "geometry"), lambda: light), shared

    return open_blocks


@pytest.mark.parametrize("maps", [False, True])
def test_blocks_are_read_as_they_were_written(opened, maps):
    blocks, _ = opened()
    parts = {(volume, *span): part(span[1] - span[0], maps) for volume in (0, 1) for span in SPANS}
    for place, values in parts.items():
        blocks.add(*place, values)
    again, shared = opened()
    for place, values in parts.items():
        for found, expected in zip(again.find(*place), values, strict=True):
            assert np.array_equal(found, expected) and found.dtype == expected.dtype
    assert again.find(0, 0, 11) is None and again.find(2, 0, 5) is None
    assert shared.resumed == ["26 light probes were restored from an interrupted bake."]


def test_blocks_of_other_light_are_gathered_again(opened):
    opened()[0].add(0, 0, 5, part(5, False))
    other, shared = opened("other")
    assert other.find(0, 0, 5) is None and shared.resumed == []
    other.add(0, 5, 7, part(2, False))
    assert opened("other")[0].find(0, 5, 7) is not None
    assert opened()[0].find(0, 5, 7) is None


def test_blocks_written_after_a_resume_leave_those_before(opened):
    opened()[0].add(0, 0, 5, part(5, False))
    opened()[0].add(0, 5, 11, part(6, False))
    blocks, _ = opened()
    assert blocks.find(0, 0, 5) is not None and blocks.find(0, 5, 11) is not None


@pytest.mark.parametrize("damaged", [True, False])
def test_blocks_replace_unreadable_files_before_any_of_their_light(opened, tmp_path, damaged):
    """The first of three files is damaged, or of another light."""
    blocks, _ = opened()
    for span in SPANS:
        blocks.add(0, *span, part(span[1] - span[0], False))
    if damaged:
        (tmp_path / "resume" / "geometry" / "probes-0").write_bytes(b"damaged")
    else:
        opened("other")[0].add(0, *SPANS[0], part(5, False))
    blocks, _ = opened()
    assert [blocks.find(0, *span) is not None for span in SPANS] == [False, True, True]
    for volume in (0, 1):
        blocks.add(volume, *SPANS[0], part(5, False))
    again, _ = opened()
    assert all(again.find(0, *span) is not None for span in SPANS) and again.find(1, *SPANS[0]) is not None
    assert len(list((tmp_path / "resume" / "geometry").iterdir())) == 4


def test_blocks_wait_until_a_checkpoint_is_due(opened, monkeypatch):
    blocks, shared = opened()
    shared.time = checkpoint.WriteThrottle(600)
    blocks.add(0, 0, 5, part(5, False))
    assert opened()[0].find(0, 0, 5) is None
    shared.time = checkpoint.WriteThrottle(0)
    blocks.add(0, 5, 11, part(6, False))
    later, _ = opened()
    assert later.find(0, 0, 5) is not None and later.find(0, 5, 11) is not None


def test_without_space_nothing_is_restored(opened):
    blocks, _ = opened(limit=100)
    blocks.add(0, 0, 5, part(5, False))
    assert opened()[0].find(0, 0, 5) is None
