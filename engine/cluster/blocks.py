"""Blocks of patches: what a worker finds, keeps and gathers for at once."""

from __future__ import annotations

#: Most patches of a block, and fewest blocks: enough of them for a slow device to take fewer than a fast one.
_LARGEST, _FEWEST = 1 << 18, 16

#: The first patch of a block, and the one after its last.
Span = tuple[int, int]


def cut(count: int, least: int = 1) -> list[Span]:
    """Return the blocks of patches, by the number of these alone.

    So the blocks, and the bits of a bake, are the same for any number of workers.

    least: patches of a block, where there are as many
    """
    size = max(least, min(_LARGEST, -(-count // _FEWEST)))
    return [(first, min(first + size, count)) for first in range(0, count, size)]
