"""Division of patches into blocks, the unit of work of a worker."""

from __future__ import annotations

#: Maximum number of patches of a block, and minimum number of blocks, so that fast devices can take more.
_LARGEST, _FEWEST = 1 << 18, 16

#: Numbers of blocks at the end that are cut in half, and after them in quarters, so that all workers finish
#: together.
_HALVED, _QUARTERED = 2, 2

#: First patch of a block, and its end.
Span = tuple[int, int]


def cut(count: int, least: int = 1) -> list[Span]:
    """Cut patches into blocks by their number alone, not by the number of workers.

    Blocks, and the bits of a bake, are therefore equal for any number of workers.

    least: minimum number of patches of each block except the last
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
