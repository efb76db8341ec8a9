"""What a person sees; draws, decides nothing."""

import bpy

from . import bake, preferences

_CLASSES = (*preferences.CLASSES, *bake.CLASSES)


def register() -> None:
    """Register the preferences and the panels."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    preferences.bind()


def unregister() -> None:
    """Unregister the panels and the preferences."""
    preferences.unbind()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
