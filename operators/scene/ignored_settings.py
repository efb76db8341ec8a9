"""Notes on settings that change the light of renders, and that bakes ignore."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ...engine.object_message import object_message
from ...engine.scene.model import Material, emits
from .light.lights import has_light_linking
from .objects.visible import visible_objects
from .scene_context import SceneContext
from .scene_objects import ReadObject

_EXPOSURE = (
    "Bakes ignore the scene's Exposure of {:g}, by which Cycles multiplies its bakes. Set it to 1 "
    "(Render Properties > Film)."
)
_CULLED = (
    "{}: Camera or Distance Culling is not baked, so these objects block and reflect light everywhere. "
    "Turn off Culling in Simplify."
)
_LINKED = (
    "{}: the light linking of emissive objects is not baked, so that they light all objects. Clear it in the "
    "Object Properties, or replace their emission by lights in a light group."
)


def note_ignored_settings(
    context: SceneContext, readings: Iterable[ReadObject], materials: tuple[Material, ...], notes: list[str]
) -> None:
    """Append notes on settings of the scene and of its objects.

    readings:   objects and instances of the bake
    materials:  their materials
    """
    exposure = getattr(context.scene, "cycles", None) and context.scene.cycles.film_exposure
    if exposure and exposure != 1:
        notes.append(_EXPOSURE.format(exposure))
    _note(_CULLED, _culled(context), notes)
    _note(_LINKED, _linked_emitters(readings, materials), notes)


def _note(sentence: str, names: list[str], notes: list[str]) -> None:
    if names:
        notes.append(object_message(sentence, names))


def _culled(context: SceneContext) -> list[str]:
    """Return the names of objects that renders may leave out because of the camera's view or distance."""
    scene = context.scene
    cycles = getattr(scene, "cycles", None)
    if cycles is None or scene.camera is None or not scene.render.use_simplify:
        return []
    kinds = [name for name in ("use_camera_cull", "use_distance_cull") if getattr(cycles, name)]
    objects = visible_objects(context) if kinds else []
    return sorted(obj.name for obj in objects if any(getattr(obj.cycles, name) for name in kinds))


def _linked_emitters(readings: Iterable[ReadObject], materials: tuple[Material, ...]) -> list[str]:
    """Return the names of emissive objects with light linking."""
    linked = {obj.session_uid: obj.name for obj in bpy.data.objects if has_light_linking(obj)}
    is_emissive = np.array([emits(material) for material in materials])
    if not linked or not is_emissive.any():
        return []
    shining = (each for each in readings if each.source in linked and is_emissive[each.mesh.slots].any())
    return sorted({linked[each.source] for each in shining})
