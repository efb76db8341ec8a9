"""Width of lightmaps: chosen from the size of the scene, fixed, or from a number of texels per metre."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from typing import NamedTuple

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty

from ..engine.errors import SettingsError
from ..engine.progress import finished
from ..engine.scene.model import Scene
from .devices import finder
from .lookup import find
from .rollback import Rollback
from .scene import SceneContext, visible_meshes
from .scene.density import ChartArea, areas_of, expected_areas, longest_side, needed_width, width_for_density
from .scene.units import metres_per_unit, texels_per_unit
from .translations import CONTEXT
from .worker_manager import poll_idle

#: Smallest and largest width that is chosen from the size of a scene, texels. 4096 texels are what most game
#: engines import without a change of settings.
_SMALLEST, _LARGEST = 64, 4096

#: Factor by which the needed width must exceed the chosen one before a bake changes it.
_GROWTH = 2.0

#: Device memory of a bake per texel, bytes, without visibility data, and the fraction of the device that may
#: be used for it. Both are chosen: lists and images of texels take 80 bytes, patches and their samples more.
_TEXEL_BYTES, _MEMORY_PART = 512, 0.5


class SizeChoice(NamedTuple):
    """Width of the lightmaps of a bake.

    width:   texels
    notes:   sentences about it for the user
    is_new:  True if it was not stored in the scene before this bake
    """

    width: int
    notes: tuple[str, ...] = ()
    is_new: bool = False


def size_properties() -> dict:
    """Return the annotations of a group of properties for the width of lightmaps."""
    return {
        "size_mode": EnumProperty(
            name="Resolution",
            description="How the width of lightmaps is chosen",
            translation_context=CONTEXT,
            items=[
                (
                    "AUTOMATIC",
                    "Automatic",
                    "Choose a width for the size of the scene at its first unwrap or bake, then keep it",
                    2,
                ),
                ("SIZE", "Fixed", "Give every lightmap this width and height", 0),
                ("DENSITY", "Density", "Choose the width that gives a number of texels per meter", 1),
            ],
            default="AUTOMATIC",
            update=_plan,
        ),
        "texels_per_metre": FloatProperty(
            name="Texels per Meter",
            description="Set the smallest mean density of the objects of a lightmap",
            default=32.0,
            min=0.001,
            soft_min=1.0,
            soft_max=1024.0,
            update=_plan,
        ),
        "largest_width": IntProperty(
            name="Max Width",
            description="Limit the width of lightmaps; objects that need more are spread over several",
            default=4096,
            min=64,
            max=16384,
            subtype="PIXEL",
            update=_plan,
        ),
        "lightmap_count": IntProperty(
            name="Lightmaps",
            description="Spread new lightmap UVs over this number of lightmaps",
            default=1,
            min=1,
            soft_max=16,
            max=1024,
        ),
        "padding": IntProperty(
            name="Padding",
            description="Keep this number of texels between charts of new UVs; bilinear filtering needs 2",
            default=2,
            min=1,
            soft_max=16,
            max=256,
            subtype="PIXEL",
        ),
        "mip_level": IntProperty(
            name="Padding to Mip",
            description="Keep the padding down to this mip level; each level needs more space",
            default=0,
            min=0,
            max=8,
        ),
        "planned_width": IntProperty(
            name="Planned Width",
            description="Width computed when Density was set, texels",
            options={"HIDDEN"},
        ),
        "automatic_width": IntProperty(
            name="Automatic Width",
            description="Width that Automatic has chosen, texels; 0 before the first unwrap or bake",
            options={"HIDDEN"},
        ),
        "lightmap_side": FloatProperty(
            name="Lightmap Side",
            description="Length of surface along the width of a lightmap, meters; 0 before the first bake",
            options={"HIDDEN"},
        ),
    }


def fix_size(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Update callback of the resolution: a width that a user or script sets replaces the automatic one."""
    settings.size_mode = "SIZE"


def choose_width(
    context: SceneContext, objects: Sequence[bpy.types.Object], changes: Rollback
) -> Generator[None, None, SizeChoice]:
    """Return the width of lightmaps, also for objects without lightmap UVs; yields between slices.

    The first automatic width is stored in the scene. All bakes and farms use the stored one.
    Raises SettingsError if a density needs too large lightmaps.
    """
    known = _known_width(context.scene.hemibake)
    if known:
        return SizeChoice(known)
    areas = yield from expected_areas(context, objects, context.scene.hemibake.uv_layer)
    settings = context.scene.hemibake
    choice = _choice(areas, settings)
    if settings.size_mode == "AUTOMATIC" and longest_side(areas) > 0:
        _store(settings, "automatic_width", choice.width, changes)
        _store_side(areas, settings, changes)
    return choice._replace(is_new=True)


def expected_width(context: SceneContext, objects: Sequence[bpy.types.Object]) -> int:
    """Return the width that `choose_width` would choose, without storing it."""
    settings = context.scene.hemibake
    known = _known_width(settings)
    return known or _choice(finished(expected_areas(context, objects, settings.uv_layer)), settings).width


def settle_width(
    scene: Scene, context: SceneContext, chosen: SizeChoice, unwrapped: bool, whole: bool, changes: Rollback
) -> SizeChoice:
    """Return the width of lightmaps after a scene was read for a provisional width; raises SettingsError.

    chosen     the provisional width
    unwrapped  charts have just been packed for that width: it becomes no smaller
    whole      all objects are baked; otherwise an automatic width stays as it is
    """
    settings, areas = context.scene.hemibake, areas_of(scene)
    _store_side(areas, settings, changes)
    if settings.size_mode == "DENSITY":
        needed = width_for_density(areas, texels_per_unit(settings))
        return SizeChoice(_within_limits(max(chosen.width, needed) if unwrapped else needed, settings))
    if settings.size_mode == "SIZE" or not whole:
        return SizeChoice(chosen.width)
    return _grown(areas, settings, chosen, changes)


def size_text(settings: bpy.types.PropertyGroup) -> str:
    """Return the width of lightmaps and, once a bake has measured it, the texel size: "1024, 4 cm/texel"."""
    width = _shown_width(settings)
    if not width:
        return "Chosen at the first bake"
    texel = texel_text(settings)
    return f"{width:,}, {texel}/texel" if texel else f"{width:,} texels"


def texel_text(settings: bpy.types.PropertyGroup) -> str:
    """Return the size of a texel, such as "4 cm"; empty before a bake has measured it."""
    width = _shown_width(settings)
    if not settings.lightmap_side or not width:
        return ""
    system = settings.id_data.unit_settings.system
    length: str = bpy.utils.units.to_string(system, "LENGTH", settings.lightmap_side / width, precision=2)
    return length.strip()


def _shown_width(settings: bpy.types.PropertyGroup) -> int:
    """Return the width that the panel shows, texels; 0 if it is not known yet."""
    return settings.planned_width if settings.size_mode == "DENSITY" else _known_width(settings)


def _known_width(settings: bpy.types.PropertyGroup) -> int:
    """Return the fixed or stored width, texels; 0 if it must be computed from the objects."""
    return {"SIZE": settings.resolution, "AUTOMATIC": settings.automatic_width}.get(settings.size_mode, 0)


def _choice(areas: Sequence[ChartArea], settings: bpy.types.PropertyGroup) -> SizeChoice:
    """Return the width for these chart areas by the mode Density or Automatic."""
    if settings.size_mode == "DENSITY":
        return SizeChoice(_width_for_density(areas, settings))
    return _automatic_choice(areas, settings)


def _grown(
    areas: Sequence[ChartArea], settings: bpy.types.PropertyGroup, chosen: SizeChoice, changes: Rollback
) -> SizeChoice:
    """Return the automatic width, larger than the chosen one if the scene needs twice as much.

    Only a change of a width that was stored before gets a note.
    """
    width = chosen.width
    if _needed(areas, settings) < _GROWTH * width:
        return SizeChoice(width)
    choice = _automatic_choice(areas, settings)
    if choice.width <= width:
        return SizeChoice(width, choice.notes)
    _store(settings, "automatic_width", choice.width, changes)
    if chosen.is_new:
        return choice
    note = (
        f"Resolution was raised from {width:,} to {choice.width:,} texels, because the scene now needs more. "
        "Choose Fixed to keep a width."
    )
    return SizeChoice(choice.width, (note, *choice.notes))


def _automatic_choice(areas: Sequence[ChartArea], settings: bpy.types.PropertyGroup) -> SizeChoice:
    """Return the power of two nearest to the needed width, with a note if device memory is too small."""
    needed = min(max(_needed(areas, settings), _SMALLEST), _LARGEST)
    wanted = 1 << round(math.log2(needed))
    width, memory = wanted, _device_memory()
    count = max(settings.lightmap_count, len(areas), 1)
    while memory and width > _SMALLEST and width**2 * count * _TEXEL_BYTES > _MEMORY_PART * memory:
        width //= 2
    if width == wanted:
        return SizeChoice(width)
    note = (
        f"Resolution is {width:,} instead of {wanted:,} texels, because the device has "
        f"{memory / 2**30:.1f} GiB. Choose Fixed to try {wanted:,}."
    )
    return SizeChoice(width, (note,))


def _needed(areas: Sequence[ChartArea], settings: bpy.types.PropertyGroup) -> float:
    return needed_width(areas, metres_per_unit(settings.id_data), settings.lightmap_count)


def _device_memory() -> int:
    """Return the memory of the OpenCL device that bakes, bytes; 0 while that is unknown.

    A process without a window does not search for devices, so that all machines of a farm choose one width.
    """
    devices = finder.found.devices if finder.found else ()
    return max((device.memory for device in devices if device.api == "OpenCL" and device.use), default=0)


def _width_for_density(areas: Sequence[ChartArea], settings: bpy.types.PropertyGroup) -> int:
    return min(width_for_density(areas, texels_per_unit(settings)), settings.largest_width)


def _within_limits(width: int, settings: bpy.types.PropertyGroup) -> int:
    """Return the width if it is within Max Width; raise SettingsError otherwise."""
    largest = settings.largest_width
    if width > largest:
        raise SettingsError(
            f"{settings.texels_per_metre:g} texels per meter need lightmaps of {width:,} texels; Max Width "
            f"is {largest:,}. Lower the density, raise Max Width, or assign objects to other lightmaps."
        )
    return width


def _store_side(areas: Sequence[ChartArea], settings: bpy.types.PropertyGroup, changes: Rollback) -> None:
    """Store the length of surface that the lightmap's width covers.

    The panel computes the texel size from it.
    """
    side = longest_side(areas, settings.lightmap_count) * metres_per_unit(settings.id_data)
    _store(settings, "lightmap_side", side, changes)


def _store(settings: bpy.types.PropertyGroup, name: str, value: float, changes: Rollback) -> None:
    """Set a property of a scene so that `changes` can undo it."""
    uid, before = settings.id_data.session_uid, getattr(settings, name)

    def restore() -> None:
        scene = find(bpy.data.scenes, uid)
        if scene is not None:
            setattr(scene.hemibake, name, before)

    changes.add(restore)
    setattr(settings, name, value)


def _plan(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Store the width that the current density requires, for display in the panel."""
    if settings.size_mode == "DENSITY" and context.scene is not None:
        where = SceneContext(context)
        objects = visible_meshes(where, viewport=True)
        areas = finished(expected_areas(where, objects, settings.uv_layer))
        settings.planned_width = _width_for_density(areas, settings)


class HEMIBAKE_OT_choose_resolution(bpy.types.Operator):
    """Choose the automatic resolution again, for the scene as it is now"""

    bl_idname = "hemibake.choose_resolution"
    bl_label = "Choose Resolution Again"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        where, settings = SceneContext(context), context.scene.hemibake
        settings.size_mode, settings.automatic_width = "AUTOMATIC", 0
        choice = finished(choose_width(where, visible_meshes(where), Rollback()))
        for note in choice.notes:
            self.report({"WARNING"}, note)
        self.report({"INFO"}, f"Resolution: {size_text(context.scene.hemibake)}. Bake again")
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_choose_resolution,)
