"""Sentences for the user that name objects."""

from __future__ import annotations

from collections.abc import Sequence

#: A sentence names this many at most.
_SHOWN = 5


def naming(sentence: str, names: Sequence[str]) -> str:
    """Return a sentence with names instead of {}.

    Of many it has the first few; a second line then has them all. `first_line` is what fits a window.
    """
    if len(names) <= _SHOWN:
        return sentence.replace("{}", _quoted(names), 1)
    few = f"{_quoted(names[:_SHOWN])} and {len(names) - _SHOWN} more"
    return f"{sentence.replace('{}', few, 1)}\nAll {len(names)}: {_quoted(names)}."


def first_line(message: str) -> str:
    """Return a message without the lines that have its details."""
    return message.strip().partition("\n")[0]


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)
