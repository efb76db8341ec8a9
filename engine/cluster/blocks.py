"""Blocks of patches: what a worker finds, keeps and gathers for at once."""

from __future__ import annotations

#: Most patches of a block, and fewest blocks of that size together: enough of them for a slow device to take
#: fewer than a fast one.
_LARGEST, _FEWEST = 1 << 18, 16

#: So many blocks' patches are cut into halves at last, and then so many into quarters: workers end together.
_HALVED, _QUARTERED = 2, 2

#: The first patch of a block, and the one after its last.
Span = tuple[int, int]


def cut(count: int, least: int = 1) -> list[Span]:
    """Return the blocks of patches, by the number of these alone.

    So the blocks, and the bits of a bake, are the same for any number of workers.

    least: patches of a block but the last, where there are as many
    """
    size = max(least, min(_LARGEST, -(-count // _FEWEST)))
    spans, first = list[Span](), 0
    while first < count:
        left = (count - first) / size
        parts = 1 if left > _HALVED + _QUARTERED else 2 if left > _QUARTERED else 4
        last = min(first + max(least, -(-size // parts)), count)
        spans.append((first, last))
        first = last
    return spans
