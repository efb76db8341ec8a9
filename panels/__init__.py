"""What a person sees; draws, decides nothing."""

import bpy

from . import (
    active_object,
    advanced,
    bake,
    check,
    last_bake,
    light_groups,
    lightmaps,
    menus,
    original_materials,
    outputs,
    preferences,
    presets,
)  # fmt: skip

#: In the order of the sidebar.
_PANELS = (
    bake,
    original_materials,
    light_groups,
    check,
    lightmaps,
    active_object,
    outputs,
    advanced,
    last_bake,
)

#: Every class that Blender has to know.
CLASSES = tuple(cls for module in (preferences, presets, menus, *_PANELS) for cls in module.CLASSES)


def register() -> None:
    """Register the preferences, the menus and the panels."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    menus.bind()


def unregister() -> None:
    """Unregister the panels, the menus and the preferences."""
    menus.unbind()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
