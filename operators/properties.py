"""Property groups of scenes and objects: settings of bakes, and data of the last bake."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from ..engine.quality import QUALITIES
from ..engine.settings import Settings, kept_with_scene
from .chart_settings import chart_properties
from .compat import PATH_OPTIONS
from .export_engines import engine_items
from .file_format import format_properties
from .light_state_names import make_state_name_unique
from .lightmap_list import unlisted
from .lightmap_size import fix_size, size_properties
from .output_switches import output_switches
from .quality_property import follow_hemicube, quality_property
from .scene.uvs.lightmap_layer import offered_layers
from .setting_properties import setting_properties
from .translations import CONTEXT


class HemibakeLightmapProperties(bpy.types.PropertyGroup):
    """A lightmap of a scene, or a map of another output beside one; `name` is unique in the scene."""

    name: StringProperty(name="Lightmap")
    image: PointerProperty(type=bpy.types.Image, name="Image")
    directional: EnumProperty(
        name="Directional",
        description="Directional maps that the last bake of the lightmap wrote",
        items=[
            ("NONE", "None", "No maps for normal maps"),
            ("DIRECTIONAL", "Directional", "L0 and L1"),
            ("SPHERICAL_HARMONICS", "Spherical Harmonics", "SH L0 and SH L1"),
        ],
        options={"HIDDEN"},
    )
    has_dominant_direction: BoolProperty(
        name="Dominant Direction",
        description="True if the last bake of the lightmap wrote its dominant direction",
        options={"HIDDEN"},
    )
    light_groups: StringProperty(
        name="Light Groups",
        description="Light groups whose maps the last bake of the lightmap wrote, as a JSON list",
        options={"HIDDEN"},
    )
    of_sun_path: BoolProperty(
        name="Of Sun Path", description="True for the map of a position of a sun path", options={"HIDDEN"}
    )
    companion_of: StringProperty(
        name="Companion Of",
        description="Lightmap to which this map of another output belongs; empty for lightmaps",
        options={"HIDDEN"},
    )
    packing: StringProperty(
        name="Packing", description="Digest of the last packing of the charts", options={"HIDDEN"}
    )
    used: FloatProperty(
        name="Used",
        description="Fraction of the lightmap that charts covered in the last bake",
        subtype="PERCENTAGE",
        min=0,
        max=100,
    )


class HemibakeStateGroupProperties(bpy.types.PropertyGroup):
    """A light group in a light state; `name` is the name of the group."""

    color: FloatVectorProperty(
        name="Color",
        description="Multiply the light of the group by this color in the state",
        subtype="COLOR",
        size=3,
        min=0.0,
        soft_max=1.0,
        default=(1.0, 1.0, 1.0),
    )
    strength: FloatProperty(
        name="Strength",
        description="Multiply the light of the group by this number in the state",
        min=0.0,
        soft_max=10.0,
        default=1.0,
    )


class HemibakeLightStateProperties(bpy.types.PropertyGroup):
    """A light state: color and strength of each light group; `name` is unique in the scene."""

    name: StringProperty(
        name="Light State",
        description="Name of the light state, for scripts and engines",
        update=make_state_name_unique,
    )
    groups: CollectionProperty(
        type=HemibakeStateGroupProperties,
        description="Light groups of the state; others have color white and strength 1",
    )
    sun_time: StringProperty(
        name="Sun Time",
        description="Time of the sun path of which a bake made the state; empty for others",
        options={"HIDDEN"},
    )


class HemibakeProbeVolumeProperties(bpy.types.PropertyGroup):
    """Light probes of a volume from the last bake; see `result.probe_images`."""

    name: StringProperty(name="Volume")
    image: PointerProperty(type=bpy.types.Image, name="Image", options={"HIDDEN"})
    light_groups: StringProperty(name="Light Groups", options={"HIDDEN"})
    resolution: IntVectorProperty(name="Resolution", size=3, options={"HIDDEN"})
    matrix: FloatVectorProperty(name="Matrix", size=16, options={"HIDDEN"})


def _layers_of_scene(
    scene: bpy.types.PropertyGroup, context: bpy.types.Context, text: str
) -> list[tuple[str, str]]:
    """Return the UV layers that a scene's property suggests, each with a note."""
    return offered_layers(scene.id_data.objects)


def _is_sun_light(settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    """Return True for the objects that a scene's sun path offers."""
    return obj.type == "LIGHT" and obj.data.type == "SUN"


def _layers_of_object(
    obj: bpy.types.PropertyGroup, context: bpy.types.Context, text: str
) -> list[tuple[str, str]]:
    """Return the UV layers that an object's property suggests, each with a note."""
    return offered_layers([obj.id_data])


class HemibakeSceneProperties(bpy.types.PropertyGroup):
    """Settings of the bakes of a scene, including settings of the engine, and the last report."""

    uv_layer: StringProperty(
        name="UV Layer",
        description="Name of the UV layer of lightmap UVs. Objects without this layer get it",
        default="Lightmap",
        search=_layers_of_scene,
    )
    target: EnumProperty(
        name="Objects",
        description="Choose the objects to bake; all others keep their lightmaps, and still cast shadows",
        translation_context=CONTEXT,
        items=[
            ("ALL", "All", "Bake all objects that renders show"),
            ("SELECTED", "Selected", "Bake the selected objects"),
            (
                "CHANGED",
                "Changed",
                "Bake objects that are new or changed, or whose light changed by more than Error Threshold",
            ),
        ],
    )
    meshes: EnumProperty(
        name="Meshes",
        description="Choose the meshes to bake; the objects are always those that renders show",
        translation_context=CONTEXT,
        items=[
            ("RENDER", "Render", "Use modifiers, particles and subdivision as in renders"),
            ("VIEWPORT", "Viewport", "Use meshes as in the viewport; hidden objects as in renders"),
        ],
    )
    show_when_done: BoolProperty(
        name="Show When Done",
        description="Show the light during a bake, and the lightmaps on the objects when it ends",
        default=True,
    )
    directory: StringProperty(
        name="Folder",
        description="Folder of the image files. An unsaved .blend gets packed images instead",
        default="//lightmaps/",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
    )
    lightmaps: CollectionProperty(
        type=HemibakeLightmapProperties, description="Lightmaps of the scene, and maps of other outputs"
    )
    probe_volumes: CollectionProperty(
        type=HemibakeProbeVolumeProperties, description="Light probes of the last bake", options={"HIDDEN"}
    )
    light_mixer: PointerProperty(
        type=bpy.types.NodeTree,
        name="Light Mixer",
        description="Node group with color and strength of each light group, for shown lightmaps",
        options={"HIDDEN"},
    )
    light_states: CollectionProperty(
        type=HemibakeLightStateProperties, description="Named mixes of the light groups"
    )
    active_light_state: IntProperty(
        name="Active Light State", description="Number of the chosen light state", options={"HIDDEN"}
    )
    light_fade: FloatProperty(
        name="Fade",
        description="Duration of the change to another light state in the preview",
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
        min=0.0,
        soft_max=10.0,
        default=1.0,
    )
    sun_times: StringProperty(
        name="Sun Path",
        description="Times of day, such as 08:00 12:30: a bake makes a light state of the sun at each",
    )
    sun_light: PointerProperty(
        type=bpy.types.Object,
        name="Sun",
        description="Sun light that follows the sun path; empty for the only one, or a Sky Texture's sun",
        poll=_is_sun_light,
    )
    sun_latitude: FloatProperty(
        name="Latitude",
        description="Latitude of the sun path, degrees, positive in the north",
        min=-90.0,
        max=90.0,
        default=50.0,
        precision=2,
    )
    sun_day: IntProperty(
        name="Day of Year", description="Day of the sun path; 172 is June 21", min=1, max=366, default=80
    )
    sun_north: FloatProperty(
        name="North Offset",
        description="Degrees from the Y axis to north, counter-clockwise seen from above",
        soft_min=-180.0,
        soft_max=180.0,
        precision=2,
    )
    baked_scene: StringProperty(
        description="Key under which this session keeps the scene of the last bake in memory",
        options={"HIDDEN"},
    )
    bake_id: StringProperty(
        name="Bake ID",
        description="ID of the scene in the bake records of objects, which several scenes may share",
        options={"HIDDEN"},
    )
    export_engine: EnumProperty(
        name="Engine",
        description="Engine of the last export",
        items=engine_items(),
        default="THREE",
        options={"HIDDEN"},
    )
    active_lightmap: IntProperty(
        name="Active Lightmap", description="Number of the chosen entry of the list", options={"HIDDEN"}
    )
    report: StringProperty(name="Report", description="Report of the last bake, as JSON", options={"HIDDEN"})
    findings: StringProperty(
        name="Findings", description="Findings of the last check, as JSON", options={"HIDDEN"}
    )


#: Settings of a new scene: a fast bake.
_NEW: Settings = replace(Settings(), **dict[str, Any](QUALITIES["preview"].values))

HemibakeSceneProperties.__annotations__.update(
    setting_properties(kept_with_scene(), _NEW, {"hemicube": follow_hemicube, "resolution": fix_size})
)
HemibakeSceneProperties.__annotations__["quality"] = quality_property()
HemibakeSceneProperties.__annotations__.update(output_switches())
HemibakeSceneProperties.__annotations__.update(size_properties())
HemibakeSceneProperties.__annotations__.update(chart_properties())
HemibakeSceneProperties.__annotations__.update(format_properties())


#: Property options that let a library override store its own settings and bake data.
_OVERRIDABLE, _INSERTABLE = {"LIBRARY_OVERRIDABLE"}, {"LIBRARY_OVERRIDABLE", "USE_INSERTION"}


class HemibakeSlotProperties(bpy.types.PropertyGroup):
    """Original content of a material slot, stored while the slot shows the lightmap."""

    link: StringProperty(description="Link of the slot: DATA or OBJECT", override=_OVERRIDABLE)
    material: PointerProperty(
        type=bpy.types.Material,
        description="Material of a slot that is linked to the object",
        override=_OVERRIDABLE,
    )


class _BakeRecord:
    """Properties of an object that a bake writes for one scene."""

    scene_id: StringProperty(
        name="Scene ID",
        description="ID of the scene that was baked; empty before a bake",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    image: PointerProperty(
        type=bpy.types.Image,
        name="Image",
        description="Image of the last bake of the object",
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
        description="Lightmap UV = UV of the mesh * scale + offset. Objects that share a mesh differ",
        default=1.0,
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    uv_offset: FloatVectorProperty(
        name="UV Offset",
        description="Offset of lightmap UVs, see UV Scale",
        size=2,
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    baked_uvs: StringProperty(
        name="Baked UVs",
        description="Digest of the lightmap UVs of the last bake of the object",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    fingerprint: StringProperty(
        name="Fingerprint",
        description="Digest of the object in its last bake",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    light_change: FloatProperty(
        name="Light Change",
        description="Relative change of its light, by bakes of other objects, since the object was baked",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    instances: StringProperty(
        name="Instances",
        description="UV transforms of the object's instances, as JSON: object, persistent_id, image, atlas, "
        "scale, offset",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )
    on_vertices: BoolProperty(
        name="On Vertices",
        description="True if the last bake of the object wrote its light to the vertices",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )


class HemibakeBakeRecord(_BakeRecord, bpy.types.PropertyGroup):
    """Record of the last bake of an object in one of several scenes."""


def _known_atlases(owner: bpy.types.bpy_struct, context: bpy.types.Context, text: str) -> list[str]:
    """Return the names of all lightmaps as suggestions; Blender filters them by the text."""
    listed = [entry.name for entry in context.scene.hemibake.lightmaps if not entry.companion_of]
    return [*listed, *unlisted(context.scene)]


def _may_be_first_level(levels: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    """Return True if an object may be chosen as the first level of another one."""
    return obj.type == "MESH" and obj != levels.id_data


class HemibakeObjectProperties(_BakeRecord, bpy.types.PropertyGroup):
    """Settings of an object for bakes, and data of its last bake."""

    role: EnumProperty(
        name="Role",
        description="Choose what a bake does with the object",
        translation_context=CONTEXT,
        items=[
            ("BAKED", "Baked", "Gets a lightmap"),
            ("NO_LIGHTMAP", "No Lightmap", "Blocks, reflects and emits light, but gets no lightmap"),
            ("IGNORED", "Ignored", "Has no effect on the bake"),
            ("DYNAMIC", "Dynamic", "Moves: left out of bakes, and lit by light probes in the preview"),
        ],
        default="BAKED",
        override=_OVERRIDABLE,
    )
    level_of: PointerProperty(
        type=bpy.types.Object,
        name="LOD Of",
        description="First level of detail, whose lightmap the object shows; bakes leave the object out",
        poll=_may_be_first_level,
        override=_OVERRIDABLE,
    )
    bake_to: EnumProperty(
        name="Bake To",
        description="Choose where the object's light is stored",
        translation_context=CONTEXT,
        items=[
            ("LIGHTMAP", "Lightmap", "Show the light of the lightmap"),
            ("VERTICES", "Vertices", "Fit the light of the lightmap to the vertices, as a color attribute"),
        ],
        override=_OVERRIDABLE,
    )
    atlas: StringProperty(
        name="Lightmap",
        description="Name of the object's lightmap; objects with the same name share it",
        search=_known_atlases,
        search_options={"SUGGESTION"},
        default="Lightmap",
        override=_OVERRIDABLE,
    )
    own_uv_layer: StringProperty(
        name="UV Layer",
        description="UV layer of lightmap UVs of this object; empty uses the scene's",
        search=_layers_of_object,
        override=_OVERRIDABLE,
    )
    lightmap_scale: FloatProperty(
        name="Texel Scale",
        description="Multiply the texel density of the object in its lightmap. Unwrap or repack to apply",
        default=1.0,
        min=0.001,
        soft_min=0.1,
        soft_max=10.0,
        override=_OVERRIDABLE,
    )
    cut_along_walls: BoolProperty(
        name="Cut UVs at Walls",
        description="End new charts at edges along walls of other objects, so that light does not leak",
        override=_OVERRIDABLE,
    )
    generated_uvs: StringProperty(
        name="Generated UVs",
        description="Digest of the lightmap UVs that Hemibake made; edited UVs differ from it",
        options={"HIDDEN"},
    )
    other_bakes: CollectionProperty(
        type=HemibakeBakeRecord, description="Records of bakes in other scenes", override=_INSERTABLE
    )
    slots: CollectionProperty(
        type=HemibakeSlotProperties,
        description="Material slots before the lightmap was shown, else empty",
        override=_INSERTABLE,
    )
    slot_added: BoolProperty(
        description="True if showing the lightmap added a material slot to the mesh",
        options={"HIDDEN"},
        override=_OVERRIDABLE,
    )


CLASSES = (
    HemibakeLightmapProperties,
    HemibakeProbeVolumeProperties,
    HemibakeStateGroupProperties,
    HemibakeLightStateProperties,
    HemibakeSceneProperties,
    HemibakeSlotProperties,
    HemibakeBakeRecord,
    HemibakeObjectProperties,
)


def bind() -> None:
    """Add the property groups to scenes and objects."""
    bpy.types.Scene.hemibake = PointerProperty(type=HemibakeSceneProperties)
    bpy.types.Object.hemibake = PointerProperty(type=HemibakeObjectProperties, override=_OVERRIDABLE)


def unbind() -> None:
    """Remove the property groups."""
    del bpy.types.Object.hemibake
    del bpy.types.Scene.hemibake
