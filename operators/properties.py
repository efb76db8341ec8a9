"""What Hemibake keeps on scenes and objects, as Blender properties."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..engine.quality import QUALITIES
from ..engine.settings import Settings, kept_with_scene
from .chart_settings import chart_properties
from .compat import PATH_OPTIONS
from .file_format import format_properties
from .lightmap_list import unlisted
from .lightmap_size import fix_size, size_properties
from .output_switches import output_switches
from .quality_property import follow_hemicube, quality_property
from .scene.uvs.lightmap_layer import offered_layers
from .setting_properties import setting_properties
from .translations import CONTEXT


class HemibakeLightmapProperties(bpy.types.PropertyGroup):
    """The image of an atlas, which is `name`."""

    name: StringProperty(name="Atlas")
    image: PointerProperty(type=bpy.types.Image, name="Image")
    directional: EnumProperty(
        name="Directional",
        description="Which directional maps the last bake of the lightmap wrote, too",
        items=[
            ("NONE", "None", "No maps that shade normal maps"),
            ("DIRECTIONAL", "Directional", "L0 and L1"),
            ("SPHERICAL_HARMONICS", "Spherical Harmonics", "SH L0 and SH L1"),
        ],
        options={"HIDDEN"},
    )
    has_dominant_direction: BoolProperty(
        name="Dominant Direction",
        description="The last bake of the lightmap wrote its dominant direction, too",
        options={"HIDDEN"},
    )
    light_groups: StringProperty(
        name="Light Groups",
        description="Light groups that the last bake of the lightmap wrote maps of, as a JSON list",
        options={"HIDDEN"},
    )
    companion_of: StringProperty(
        name="Companion Of",
        description="Lightmap that this is a map beside, of another output; empty for a lightmap itself",
        options={"HIDDEN"},
    )
    packing: StringProperty(
        name="Packing",
        description="Digest of how the charts of the lightmap were packed last",
        options={"HIDDEN"},
    )
    used: FloatProperty(
        name="Used",
        description="Part of the lightmap that the charts of its objects cover, as they were baked last",
        subtype="PERCENTAGE",
        min=0,
        max=100,
    )


def _layers_of_scene(
    scene: bpy.types.PropertyGroup, context: bpy.types.Context, text: str
) -> list[tuple[str, str]]:
    """Return the UV layers that are offered for a scene."""
    return offered_layers(scene.id_data.objects)


def _layers_of_object(
    obj: bpy.types.PropertyGroup, context: bpy.types.Context, text: str
) -> list[tuple[str, str]]:
    """Return the UV layers that are offered for an object."""
    return offered_layers([obj.id_data])


class HemibakeSceneProperties(bpy.types.PropertyGroup):
    """How the scene is baked, with the engine's settings that are the scene's; the last bake's report."""

    uv_layer: StringProperty(
        name="UV Layer",
        description="UV layer with the lightmap UVs; made where an object has none. The list shows those "
        "that exist, the likeliest lightmap UVs first",
        default="Lightmap",
        search=_layers_of_scene,
    )
    target: EnumProperty(
        name="Target",
        description="Which objects are baked",
        translation_context=CONTEXT,
        items=[
            ("ALL", "All", "Every object with a lightmap that renders show"),
            (
                "SELECTED",
                "Selected",
                "Selected objects: all others keep the light of their lightmaps, and still shade and reflect",
            ),
            (
                "CHANGED",
                "Changed",
                "Objects that are new, whose shape, place or materials have changed since they were baked, "
                "or whose light can have changed by more than the tolerance: quick bakes, of the scene "
                "of the last bake and of now, tell. All others keep the texels of their lightmaps",
            ),
        ],
    )
    meshes: EnumProperty(
        name="Meshes",
        description="Which meshes are baked. The objects are always those that renders show",
        translation_context=CONTEXT,
        items=[
            ("RENDER", "Render", "Modifiers, particles and subdivision as in renders"),
            ("VIEWPORT", "Viewport", "Meshes as in the viewport; of objects hidden there as in renders"),
        ],
    )
    show_when_done: BoolProperty(
        name="Show When Done",
        description="Show the lightmaps on the objects once a bake in a window has ended",
        default=True,
    )
    directory: StringProperty(
        name="Folder",
        description="Where lightmaps are written; packed into the .blend while that has not been saved",
        default="//lightmaps/",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
    )
    lightmaps: CollectionProperty(
        type=HemibakeLightmapProperties,
        description="Image of each atlas that has been baked in the scene",
    )
    light_mixer: PointerProperty(
        type=bpy.types.NodeTree,
        name="Light Mixer",
        description="Node group with color and strength of each light group, which the preview shows",
        options={"HIDDEN"},
    )
    baked_scene: StringProperty(
        description="Name of the scene as it was last baked, while Blender remembers it", options={"HIDDEN"}
    )
    active_lightmap: IntProperty(
        name="Active Lightmap", description="Lightmap that is chosen in the list", options={"HIDDEN"}
    )
    report: StringProperty(
        name="Report",
        description="Report of the last bake, as JSON",
        options={"HIDDEN"},
    )
    findings: StringProperty(
        name="Findings",
        description="What the last check has found, as JSON",
        options={"HIDDEN"},
    )


#: Settings of a new scene: the first lightmap comes soon.
_NEW = Settings(**QUALITIES["preview"].values)

HemibakeSceneProperties.__annotations__.update(
    setting_properties(kept_with_scene(), _NEW, {"hemicube": follow_hemicube, "resolution": fix_size})
)
HemibakeSceneProperties.__annotations__["quality"] = quality_property()
HemibakeSceneProperties.__annotations__.update(output_switches())
HemibakeSceneProperties.__annotations__.update(size_properties())
HemibakeSceneProperties.__annotations__.update(chart_properties())
HemibakeSceneProperties.__annotations__.update(format_properties())


#: An object that overrides one of another file keeps what is chosen for it, and what was baked.
_OVERRIDABLE, _INSERTABLE = {"LIBRARY_OVERRIDABLE"}, {"LIBRARY_OVERRIDABLE", "USE_INSERTION"}


class HemibakeSlotProperties(bpy.types.PropertyGroup):
    """What a material slot held before the preview."""

    link: StringProperty(
        description="Where the slot's material was linked: DATA or OBJECT", override=_OVERRIDABLE
    )
    material: PointerProperty(
        type=bpy.types.Material, description="Material linked to the object", override=_OVERRIDABLE
    )


def _known_atlases(owner: bpy.types.bpy_struct, context: bpy.types.Context, text: str) -> list[str]:
    """Return the lightmaps that a field offers: Blender itself looks which of them fit the text."""
    listed = [entry.name for entry in context.scene.hemibake.lightmaps if not entry.companion_of]
    return [*listed, *unlisted(context.scene)]


class HemibakeObjectProperties(bpy.types.PropertyGroup):
    """What a bake does with an object, and which lightmap it belongs to."""

    role: EnumProperty(
        name="Role",
        description="What a bake does with the object",
        translation_context=CONTEXT,
        items=[
            ("BAKED", "Baked", "The object gets a place in a lightmap"),
            ("NO_LIGHTMAP", "Occluder", "The object stops, reflects and emits light, but gets no lightmap"),
            ("IGNORED", "Ignored", "The bake does not see the object"),
        ],
        default="BAKED",
        override=_OVERRIDABLE,
    )
    atlas: StringProperty(
        name="Atlas",
        description="Lightmap that holds the object's charts; objects with the same name here are in one",
        search=_known_atlases,
        search_options={"SUGGESTION"},
        default="Lightmap",
        override=_OVERRIDABLE,
    )
    own_uv_layer: StringProperty(
        name="UV Layer",
        description="UV layer with the lightmap UVs of this object; empty for that of the scene",
        search=_layers_of_object,
        override=_OVERRIDABLE,
    )
    lightmap_scale: FloatProperty(
        name="Scale in Lightmap",
        description="Factor on the texels per metre of the object; used when its lightmap UVs are made, "
        "repacked or moved",
        default=1.0,
        min=0.001,
        soft_min=0.1,
        soft_max=10.0,
        override=_OVERRIDABLE,
    )
    cut_along_walls: BoolProperty(
        name="Cut Along Walls",
        description="New lightmap charts of the object end at its edges that run under or beside walls of "
        "other objects: what is lit on one side of a thin wall then does not show on the other",
        override=_OVERRIDABLE,
    )
    generated_uvs: StringProperty(
        name="Made UVs",
        description="Digest of the lightmap UVs that Hemibake made: those that differ are the user's",
        options={"HIDDEN"},
    )
    image: PointerProperty(
        type=bpy.types.Image,
        name="Image",
        description="Image that the last bake of the object wrote",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    uv_layer: StringProperty(
        name="UV Layer",
        description="UV layer that the last bake of the object used",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    uv_scale: FloatProperty(
        name="UV Scale",
        description="Lightmap UV = UV of the mesh * scale + offset: objects of one mesh differ in it",
        default=1.0,
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    uv_offset: FloatVectorProperty(
        name="UV Offset",
        description="See UV Scale",
        size=2,
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    baked_uvs: StringProperty(
        name="Baked UVs",
        description="Digest of the lightmap UVs that the last bake of the object used",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    fingerprint: StringProperty(
        name="Fingerprint",
        description="Digest of what the last bake saw of the object",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    light_change: FloatProperty(
        name="Light Change",
        description="How much the light of the object may have changed since it was baked, as a fraction, at "
        "bakes that left it as it was",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    instances: StringProperty(
        name="Instances",
        description="Where the charts of the instances are that the object makes, as JSON: object, "
        "persistent_id, image, atlas, scale, offset",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    slots: CollectionProperty(
        type=HemibakeSlotProperties,
        description="Material slots as they were before the preview, empty without one",
        override=_INSERTABLE,
    )
    slot_added: BoolProperty(
        description="The preview added a material slot to the object's mesh",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )


CLASSES = (
    HemibakeLightmapProperties,
    HemibakeSceneProperties,
    HemibakeSlotProperties,
    HemibakeObjectProperties,
)


def bind() -> None:
    """Attach the groups to scenes and objects."""
    bpy.types.Scene.hemibake = PointerProperty(type=HemibakeSceneProperties)
    bpy.types.Object.hemibake = PointerProperty(type=HemibakeObjectProperties, override=_OVERRIDABLE)


def unbind() -> None:
    """Detach the groups."""
    del bpy.types.Object.hemibake
    del bpy.types.Scene.hemibake
