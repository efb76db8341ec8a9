"""Unit scale of a scene: settings are in metres, coordinates in Blender's units.

Lights use Blender's units, as in Cycles, which ignores the unit scale.
"""

from __future__ import annotations

import bpy


def metres_per_unit(scene: bpy.types.Scene) -> float:
    """Return the metres per unit of length; 1 if the unit system is None."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else float(units.scale_length)


def texels_per_unit(settings: bpy.types.PropertyGroup) -> float:
    """Return the texels per unit of length that a scene's setting of texels per metre demands."""
    return settings.texels_per_metre * metres_per_unit(settings.id_data)
