"""The unit scale of a scene: settings are in metres, coordinates in Blender's units.

Lights keep Blender's units, as in Cycles, which takes no notice of the unit scale.
"""

from __future__ import annotations

import bpy


def metres_per_unit(scene: bpy.types.Scene) -> float:
    """Return how many metres a unit of length is; 1 where Blender shows bare numbers."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else float(units.scale_length)


def texels_per_unit(settings: bpy.types.PropertyGroup) -> float:
    """Return the texels per metre that a scene's settings demand, per unit of length."""
    return settings.texels_per_metre * metres_per_unit(settings.id_data)
