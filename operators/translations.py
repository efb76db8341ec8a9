"""What the words of the interface mean, for translations: none is needed to use Hemibake.

Blender looks up each label in its own catalogues, too. Words that mean something else there have a context
of ours, so that only a translation below is taken for them.
"""

from __future__ import annotations

import bpy

from .extension import EXTENSION

#: Context of words that are ambiguous, as of Draft, High, Selected and Ignored.
CONTEXT = "Hemibake"

#: By locale such as "de_DE": (context, English) -> translation, as `bpy.app.translations.register` takes it.
TRANSLATIONS: dict[str, dict[tuple[str, str], str]] = {}


def bind() -> None:
    """Let Blender know the translations."""
    bpy.app.translations.register(EXTENSION, TRANSLATIONS)


def unbind() -> None:
    """Take them away again."""
    bpy.app.translations.unregister(EXTENSION)
