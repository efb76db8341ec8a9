"""The settings of a scene and of an object, as Blender properties.

The limits of numbers are soft: a script that leaves them gets the engine's message, not a silent clamp.
"""

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

from ..engine.settings import HEMICUBES, METHODS, VISIBILITIES, Settings
from .compat import PATH_OPTIONS

_METHOD_NAMES = {
    "auto": ("Automatic", "Cached if there is memory for it, else Stream"),
    "cached": (
        "Cached",
        "Find once what each patch sees; iterations only look radiance up. "
        "Needs memory: where it is not enough, as Stream",
    ),
    "stream": ("Stream", "Find anew in every iteration what each patch sees: slow, but needs no memory"),
    "paper": ("Paper", "Draw radiance hemicubes anew in every iteration, as in the paper"),
}
_VISIBILITY_NAMES = {
    "auto": (
        "Automatic",
        "Take the faster one, found by a trial on the scene; bakes are repeatable with the others",
    ),
    "raster": ("Raster", "Draw hemicubes with OpenGL"),
    "rays": ("Rays", "Cast rays with OpenCL"),
}
_OUTPUTS = [
    ("combined", "Combined", "All light that a surface receives"),
    ("direct", "Direct", "Light that comes straight from lights, emissive surfaces and the world"),
    ("indirect", "Indirect", "Light that other surfaces reflect"),
    ("ambient_occlusion", "Ambient Occlusion", "Share of the hemisphere without a surface nearby"),
    ("shadow_mask", "Shadow Masks", "A map for each light: 1 where it is seen whole, 0 in its shadow"),
]
_HEMICUBES = [(str(n), str(n), f"{n} texels wide: {3 * n * n} samples per patch") for n in HEMICUBES]
_METHODS = [(name, *_METHOD_NAMES[name]) for name in METHODS]
_VISIBILITIES = [(name, *_VISIBILITY_NAMES[name]) for name in VISIBILITIES]


class HemibakeLightmapProperties(bpy.types.PropertyGroup):
    """The image of an atlas, which is `name`."""

    name: StringProperty(name="Atlas")
    image: PointerProperty(type=bpy.types.Image, name="Image")


class HemibakeSceneProperties(bpy.types.PropertyGroup):
    """How the scene is baked, and what the last bake told."""

    resolution: IntProperty(
        name="Resolution",
        description="Width and height of each lightmap, in texels",
        default=Settings.resolution,
        soft_min=8,
        soft_max=16384,
    )
    hemicube: EnumProperty(
        name="Hemicube",
        description="Width of the hemicubes: what each patch sees, in texels",
        items=_HEMICUBES,
        default=str(Settings.hemicube),
    )
    iterations: IntProperty(
        name="Iterations",
        description="Largest number of light bounces",
        default=Settings.iterations,
        soft_min=1,
        soft_max=1000,
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="Stop once the estimated remaining error of the texels, each relative to its own light, "
        "is below this on average",
        default=Settings.tolerance,
        soft_min=0.0,
        soft_max=1.0,
        precision=4,
        step=0.1,
    )
    outputs: EnumProperty(
        name="Outputs",
        description="What a bake gives: an image of each",
        items=_OUTPUTS,
        options={"ENUM_FLAG"},
        default=set(Settings.outputs),
    )
    light_samples: IntProperty(
        name="Light Samples",
        description="Shadow rays from each patch to each light",
        default=Settings.light_samples,
        soft_min=1,
        soft_max=4096,
    )
    sample_emission: BoolProperty(
        name="Sample Emission",
        description="Sample small bright emissive surfaces and bright sky as lights; off leaves them to the "
        "hemicubes, as in the paper",
        default=Settings.sample_emission,
    )
    ao_samples: IntProperty(
        name="AO Samples",
        description="Rays of each patch for ambient occlusion",
        default=Settings.ao_samples,
        soft_min=1,
        soft_max=65536,
    )
    ao_distance: FloatProperty(
        name="AO Distance",
        description="How far ambient occlusion reaches; 0 for any distance",
        default=Settings.ao_distance,
        soft_min=0.0,
        subtype="DISTANCE",
    )
    method: EnumProperty(
        name="Method",
        description="How the light that a patch receives is computed",
        items=_METHODS,
        default=Settings.method,
    )
    visibility: EnumProperty(
        name="Visibility",
        description="How it is found what a patch sees",
        items=_VISIBILITIES,
        default=Settings.visibility,
    )
    samples: IntProperty(
        name="Samples",
        description="Rays of each patch, where rays are cast; 0 for as many as give the error of a hemicube",
        default=Settings.samples,
        soft_min=0,
        soft_max=65536,
    )
    seed: IntProperty(
        name="Seed",
        description="Seed of the random rotation of each hemicube",
        default=Settings.seed,
        soft_min=0,
    )
    dilation: IntProperty(
        name="Dilation",
        description="How far charts are extended in the stored image, in texels",
        default=Settings.dilation,
        soft_min=0,
        soft_max=256,
    )
    uv_layer: StringProperty(
        name="UV Layer",
        description="Name of the UV layer with the lightmap UVs; made where an object has none",
        default="Lightmap",
    )
    directory: StringProperty(
        name="Folder",
        description="Where lightmaps are written; packed into the .blend while that has not been saved",
        default="//lightmaps/",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
    )
    patch_file: StringProperty(
        name="Patch List",
        description="File that keeps the patch list between bakes of the same UVs; empty for none",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
    )
    lightmaps: CollectionProperty(
        type=HemibakeLightmapProperties,
        description="Image of each atlas that has been baked in the scene",
    )
    report: StringProperty(
        name="Report",
        description="What the last bake told, as JSON",
        options={"HIDDEN"},
    )


class HemibakeSlotProperties(bpy.types.PropertyGroup):
    """What a material slot held before the preview."""

    link: StringProperty(description="Where the slot's material was linked: DATA or OBJECT")
    material: PointerProperty(type=bpy.types.Material, description="Material linked to the object")


class HemibakeObjectProperties(bpy.types.PropertyGroup):
    """What a bake does with an object, and which lightmap it belongs to."""

    role: EnumProperty(
        name="Role",
        description="What a bake does with the object",
        items=[
            ("BAKED", "Baked", "The object gets a place in a lightmap"),
            ("OCCLUDER", "Occluder", "The object stops, reflects and emits light, but gets no lightmap"),
            ("IGNORED", "Ignored", "The bake does not see the object"),
        ],
        default="BAKED",
    )
    atlas: StringProperty(
        name="Atlas",
        description="Lightmap that holds the object's charts; objects with the same name here share one",
        default="Lightmap",
    )
    image: PointerProperty(
        type=bpy.types.Image,
        name="Image",
        description="Image that the last bake of the object wrote",
        options={"HIDDEN"},
    )
    uv_layer: StringProperty(
        name="UV Layer",
        description="UV layer that the last bake of the object used",
        options={"HIDDEN"},
    )
    uv_scale: FloatProperty(
        name="UV Scale",
        description="Lightmap UV = UV of the mesh * scale + offset: objects that share a mesh differ in it",
        default=1.0,
        options={"HIDDEN"},
    )
    uv_offset: FloatVectorProperty(
        name="UV Offset",
        description="See UV Scale",
        size=2,
        options={"HIDDEN"},
    )
    instances: StringProperty(
        name="Instances",
        description="Where the charts of the instances are that the object makes, as JSON: object, "
        "persistent_id, image, scale, offset",
        options={"HIDDEN"},
    )
    slots: CollectionProperty(
        type=HemibakeSlotProperties,
        description="Material slots as they were before the preview, empty without one",
    )
    slot_added: BoolProperty(
        description="The preview added a material slot to the object's mesh",
        options={"HIDDEN"},
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
    bpy.types.Object.hemibake = PointerProperty(type=HemibakeObjectProperties)


def unbind() -> None:
    """Detach the groups."""
    del bpy.types.Object.hemibake
    del bpy.types.Scene.hemibake
