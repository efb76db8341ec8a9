"""What a person sees; draws, decides nothing."""

import bpy

from . import active_object, advanced, bake, last_bake, lightmaps, outputs, preferences, presets

#: In the order of the sidebar.
_PANELS = (bake, lightmaps, active_object, outputs, advanced, last_bake)

#: Every class that Blender has to know.
CLASSES = tuple(cls for module in (preferences, presets, *_PANELS) for cls in module.CLASSES)


def register() -> None:
    """Register the preferences and the panels."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    preferences.bind()


def unregister() -> None:
    """Unregister the panels and the preferences."""
    preferences.unbind()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
