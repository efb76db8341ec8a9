"""Sentences for the user that name objects."""

from __future__ import annotations

from collections.abc import Sequence


class Note(str):
    """A sentence for the user that is about objects of the scene.

    objects  their names
    """

    __slots__ = ("objects",)

    objects: tuple[str, ...]

    def __new__(cls, text: str, objects: Sequence[str] = ()) -> Note:
        """Make it of its text and the names."""
        note = super().__new__(cls, text)
        note.objects = tuple(objects)
        return note


#: A sentence names this many at most.
_SHOWN = 5


def naming(sentence: str, objects: Sequence[str]) -> Note:
    """Return a sentence about objects, with their names instead of {}; see `listing`."""
    return Note(listing(sentence, objects), objects)


def objects_of(note: str) -> tuple[str, ...]:
    """Return the names of the objects that a sentence is about."""
    return note.objects if isinstance(note, Note) else ()


def listing(sentence: str, names: Sequence[str]) -> str:
    """Return a sentence with names of anything instead of {}.

    Of many it has the first few; a second line then has them all. `first_line` is what fits a window.
    """
    if len(names) <= _SHOWN:
        return sentence.replace("{}", _quoted(names), 1)
    few = f"{_quoted(names[:_SHOWN])} and {len(names) - _SHOWN} more"
    return f"{sentence.replace('{}', few, 1)}\nAll {len(names)}: {_quoted(names)}."


def counted(number: int, word: str, ending: str = "s") -> str:
    """Return a number with what it counts, such as "1 object" or "1,021 patches"."""
    return f"{number:,} {word}{'' if number == 1 else ending}"


def first_line(message: str) -> str:
    """Return a message without the lines that have its details."""
    return message.strip().partition("\n")[0]


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)
