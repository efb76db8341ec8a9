"""User messages that refer to objects by name."""

from __future__ import annotations

from collections.abc import Sequence


class ObjectMessage(str):
    """User message about objects of the scene.

    objects:  names of the objects
    fix:      identifier of the fix that the interface offers; empty if there is none
    """

    __slots__ = ("fix", "objects")

    objects: tuple[str, ...]
    fix: str

    def __new__(cls, text: str, objects: Sequence[str] = (), fix: str = "") -> ObjectMessage:
        """Create the message from its text, object names and fix."""
        note = super().__new__(cls, text)
        note.objects, note.fix = tuple(objects), fix
        return note


#: Maximum number of names in the first line.
_SHOWN = 5


def object_message(sentence: str, objects: Sequence[str], fix: str = "") -> ObjectMessage:
    """Return a message about objects, with {} in the sentence replaced by their names."""
    return ObjectMessage(listing(sentence, objects), objects, fix)


def objects_of(note: str) -> tuple[str, ...]:
    """Return the names of the objects in a message."""
    return note.objects if isinstance(note, ObjectMessage) else ()


def fix_of(note: str) -> str:
    """Return the identifier of the fix that a message offers; empty if there is none."""
    return note.fix if isinstance(note, ObjectMessage) else ""


def listing(sentence: str, names: Sequence[str]) -> str:
    """Return a sentence with {} replaced by quoted names.

    With many names, the first line lists a few and a second line lists all. `first_line` returns the part
    that fits a window.
    """
    if len(names) <= _SHOWN:
        return sentence.replace("{}", _quoted(names), 1)
    few = f"{_quoted(names[:_SHOWN])} and {len(names) - _SHOWN} more"
    return f"{sentence.replace('{}', few, 1)}\nAll {len(names)}: {_quoted(names)}."


def counted(number: int, word: str, ending: str = "s") -> str:
    """Return a number with its noun, such as "1 object" or "1,021 patches"."""
    return f"{number:,} {word}{'' if number == 1 else ending}"


def first_line(message: str) -> str:
    """Return a message without the lines of details."""
    return message.strip().partition("\n")[0]


def _quoted(names: Sequence[str]) -> str:
    return ", ".join(f"'{name}'" for name in names)
