"""Sentences for the user that name objects."""

from __future__ import annotations

from collections.abc import Sequence


class ObjectMessage(str):
    """A sentence for the user that is about objects of the scene.

    objects  their names
    fix      name of what mends it in the interface; empty if nothing does by itself
    """

    __slots__ = ("fix", "objects")

    objects: tuple[str, ...]
    fix: str

    def __new__(cls, text: str, objects: Sequence[str] = (), fix: str = "") -> ObjectMessage:
        """Make it of its text and the names."""
        note = super().__new__(cls, text)
        note.objects, note.fix = tuple(objects), fix
        return note


#: A sentence names this many at most.
_SHOWN = 5


def object_message(sentence: str, objects: Sequence[str], fix: str = "") -> ObjectMessage:
    """Return a sentence about objects, with their names instead of {}; see `listing`."""
    return ObjectMessage(listing(sentence, objects), objects, fix)


def objects_of(note: str) -> tuple[str, ...]:
    """Return the names of the objects that a sentence is about."""
    return note.objects if isinstance(note, ObjectMessage) else ()


def fix_of(note: str) -> str:
    """Return the name of what mends what a sentence tells, empty if nothing does."""
    return note.fix if isinstance(note, ObjectMessage) else ""


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
