"""The width of lightmaps: one number of texels, or as many as give a number of texels a metre."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ..engine.errors import SettingsError
from ..engine.scene.model import Scene
from .scene import SceneContext, visible_meshes
from .scene.density import width_before, width_of
from .scene.units import texels_per_unit
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
        "largest_width": IntProperty(
            name="Largest",
            description="Greatest width of a lightmap, in texels: objects that need more get several",
            default=4096,
            min=64,
            max=16384,
            subtype="PIXEL",
            update=_plan,
        ),
        "lightmap_count": IntProperty(
            name="Lightmaps",
            description="Lightmaps that new lightmap UVs are spread over, as dense as fits them",
            default=1,
            min=1,
            soft_max=16,
            max=1024,
        ),
        "padding": IntProperty(
            name="Padding",
            description="Texels that charts keep between them in new lightmap UVs. Two are enough for "
            "bilinear filtering",
            default=2,
            min=1,
            soft_max=16,
            max=256,
            subtype="PIXEL",
        ),
        "mip_level": IntProperty(
            name="Mip Level",
            description="Coarsest mip level at which charts still keep the padding; each takes room",
            default=0,
            min=0,
            max=8,
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
    width = width_before(context, objects, settings.uv_layer, texels_per_unit(settings))
    return min(width, settings.largest_width)


def width_for(scene: Scene, settings: bpy.types.PropertyGroup, width: int, unwrapped: bool) -> int:
    """Return the width of lightmaps for a scene that was read for a width; raises SettingsError.

    unwrapped  charts have just been packed for that width: it becomes no smaller
    """
    if settings.size_mode == "SIZE":
        return width
    needed = width_of(scene, texels_per_unit(settings))
    return _within_limits(max(width, needed) if unwrapped else needed, settings)


def _within_limits(width: int, settings: bpy.types.PropertyGroup) -> int:
    largest = settings.largest_width
    if width > largest:
        raise SettingsError(
            f"{settings.texels_per_metre:g} texels per metre need lightmaps of {width:,} texels, {largest:,} "
            "are the most. Lower them, raise Largest, or give objects lightmaps of their own."
        )
    return width


def _plan(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Keep how wide lightmaps would be now, for the panel."""
    if settings.size_mode == "DENSITY" and context.scene is not None:
        where = SceneContext(context)
        meshes, density = visible_meshes(where, viewport=True), texels_per_unit(settings)
        width = width_before(where, meshes, settings.uv_layer, density)
        settings.planned_width = min(width, settings.largest_width)
