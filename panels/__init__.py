"""What a person sees; draws, decides nothing."""

import bpy

from . import bake

_CLASSES = (*bake.CLASSES,)


def register() -> None:
    """Register the panels."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Unregister the panels."""
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
