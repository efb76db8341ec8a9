"""Sentences for the user that name objects."""

from __future__ import annotations

from collections.abc import Sequence

#: A message names this many at most.
_SHOWN = 5


def listed(names: Sequence[str]) -> str:
    """Return names in quotes, the first few of many."""
    shown = ", ".join(f"'{name}'" for name in names[:_SHOWN])
    return f"{shown} and {len(names) - _SHOWN} more" if len(names) > _SHOWN else shown
