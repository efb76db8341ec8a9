"""The width of lightmaps: one number of texels, or as many as give a number of texels a metre."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ..engine.errors import SettingsError
from ..engine.scene.model import Scene
from ..engine.settings import descriptions
from .scene import SceneContext, visible_meshes
from .scene.density import width_before, width_of
from .translations import CONTEXT


def size_properties() -> dict:
    """Return the annotations of a group of properties for the width of lightmaps."""
    return {
        "size_mode": EnumProperty(
            name="Size",
            description="How the width of the lightmaps is chosen",
            translation_context=CONTEXT,
            items=[
                ("SIZE", "Resolution", "Every lightmap has this width and height, in texels"),
                ("DENSITY", "Density", "As many texels as give a number of them per metre of surface"),
            ],
            update=_plan,
        ),
        "texels_per_metre": FloatProperty(
            name="Texels per Metre",
            description="Least mean density of the objects of each lightmap",
            default=32.0,
            min=0.001,
            soft_min=1.0,
            soft_max=1024.0,
            update=_plan,
        ),
        "planned_width": IntProperty(
            name="Planned Width",
            description="Width that the texels per metre demanded when they were chosen",
            options={"HIDDEN"},
        ),
    }


def chosen_width(
    context: SceneContext, objects: Sequence[bpy.types.Object], settings: bpy.types.PropertyGroup
) -> int:
    """Return the width of lightmaps for objects that may not be unwrapped yet; raises SettingsError."""
    if settings.size_mode == "SIZE":
        return settings.resolution
    return _within_limits(
        width_before(context, objects, settings.uv_layer, settings.texels_per_metre), settings
    )


def width_for(scene: Scene, settings: bpy.types.PropertyGroup, width: int, unwrapped: bool) -> int:
    """Return the width of lightmaps for a scene that was read for a width; raises SettingsError.

    unwrapped  charts have just been packed for that width: it becomes no smaller
    """
    if settings.size_mode == "SIZE":
        return width
    needed = _within_limits(width_of(scene, settings.texels_per_metre), settings)
    return max(width, needed) if unwrapped else needed


def _within_limits(width: int, settings: bpy.types.PropertyGroup) -> int:
    largest = int(descriptions()["resolution"].values.high)
    if width > largest:
        raise SettingsError(
            f"{settings.texels_per_metre:g} texels per metre need lightmaps of {width:,} texels, {largest:,} "
            "are the most. Lower them, or give objects lightmaps of their own."
        )
    return width


def _plan(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Keep how wide lightmaps would be now, for the panel."""
    if settings.size_mode == "DENSITY" and context.scene is not None:
        where = SceneContext(context)
        meshes, density = visible_meshes(where), settings.texels_per_metre
        settings.planned_width = width_before(where, meshes, settings.uv_layer, density)
