"""Translations of the interface, and the context of ambiguous labels.

Blender also searches its own catalogues for each label. Labels that mean something else there get our own
context, so that Blender uses only translations from this module.
"""

from __future__ import annotations

import bpy

from .extension import EXTENSION

#: Translation context of ambiguous labels, such as Draft, High, Selected and Ignored.
CONTEXT = "Hemibake"

#: Translations by locale such as "de_DE", in the form that `bpy.app.translations.register` requires:
#: (context, English) -> translation.
TRANSLATIONS: dict[str, dict[tuple[str, str], str]] = {}


def bind() -> None:
    """Register the translations."""
    bpy.app.translations.register(EXTENSION, TRANSLATIONS)


def unbind() -> None:
    """Unregister the translations."""
    bpy.app.translations.unregister(EXTENSION)
