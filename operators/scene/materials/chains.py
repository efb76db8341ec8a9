"""Order in which long chains of nodes are evaluated without recursion."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

Item = TypeVar("Item")


def inputs_first(
    start: Item, inputs: Callable[[Item], Sequence[Item]], key: Callable[[Item], Hashable]
) -> list[Item]:
    """Return all items on which an item depends, and the item itself, each once and after its inputs.

    Depth-first search with a stack: Python's recursion ends after some hundred nodes. Items that depend on
    each other in a circle have an arbitrary order.

    inputs:  returns the items on which an item depends directly
    key:     returns a value that is equal for equal items
    """
    order: list[Item] = []
    visited: set[Hashable] = set()
    waiting = [(start, False)]
    while waiting:
        item, is_complete = waiting.pop()
        if is_complete:
            order.append(item)
        elif key(item) not in visited:
            visited.add(key(item))
            waiting.append((item, True))
            waiting += [(each, False) for each in reversed(inputs(item))]
    return order
