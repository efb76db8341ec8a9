"""Panels and menus: they draw the state of the add-on and contain no other logic."""

import bpy

from . import (
    active_object,
    advanced,
    bake,
    check,
    export,
    last_bake,
    light_groups,
    light_probes,
    lightmaps,
    menus,
    original_material,
    outputs,
    preferences,
    presets,
)  # fmt: skip

#: Modules of panels, in the order of the sidebar.
_PANELS = (
    bake,
    original_material,
    check,
    last_bake,
    active_object,
    lightmaps,
    outputs,
    light_groups,
    light_probes,
    advanced,
)

#: All classes to register with Blender.
CLASSES = tuple(cls for module in (preferences, presets, menus, export, *_PANELS) for cls in module.CLASSES)


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
