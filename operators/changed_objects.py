"""Which objects a bake of changed ones bakes, and what is remembered of it for the next."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import bpy

from ..engine.bake_result import BakeResult
from ..engine.errors import OverlapError
from ..engine.object_message import object_message
from ..engine.progress import Progress
from ..engine.scene.model import Scene
from ..engine.settings import Settings
from .run_stages import RunStages
from .scene import ReadScene
from .scene.bake_records import bake_record, writable_record
from .scene.bake_targets import NothingChangedError, changed_themselves, changed_uids
from .scene.light_changes import (
    ALL_LIGHT,
    QuickBakes,
    comparison_settings,
    differing_lights,
    light_changes,
    tells_all,
)
from .scene_snapshots import baked_scenes

Bake = Generator[Progress | None, None, BakeResult]

#: Why objects are baked: of themselves, and where it is not known how much light has changed.
_CHANGED = "Baked since they are new, or their shape, place or materials have changed: {}."
_LIGHTS_DIFFER = "Baked since lights, shining objects or the world have changed: {}."

#: What a bake leaves as it was where it is not known how much light has changed.
_OTHERS_STAY = (
    "Only what has changed was baked: its shadows and its reflected light on all else are as before. "
    "Bake All in the end."
)


@dataclass(frozen=True)
class ChangedObjects:
    """What is to be baked, and why.

    uids     session uids of the objects
    changes  how much the light of each object that was baked before may have changed since, a fraction; None
             where that is not known
    notes    sentences for the user
    """

    uids: set[int]
    changes: dict[int, float] | None
    notes: tuple[str, ...]


def find_changed_objects(
    read: ReadScene,
    wanted: set[int],
    settings: Settings,
    bake: Callable[[Scene, Settings], Bake],
    stages: RunStages,
    scene: bpy.types.Scene,
) -> Generator[Progress | None, None, ChangedObjects]:
    """Return which of the wanted objects, by session uid, are other than when they were baked, or are lit so.

    scene  Blender's, which knows its name as it was last baked

    Raises NothingChangedError if none is.
    """
    changes = yield from _changes(read, settings, bake, stages, scene.hemibake.baked_scene)
    uids, own = changed_uids(read, wanted, scene), changed_themselves(read, wanted, scene)
    if changes is None:
        notes = _named(_LIGHTS_DIFFER, uids - own)
        notes += [_OTHERS_STAY] if 0 < len(uids) < len(read.fingerprints) else []
    else:
        earlier = {obj.session_uid: bake_record(obj, scene).light_change for obj in bpy.data.objects}
        changes = {uid: change + earlier.get(uid, 0.0) for uid, change in changes.items()}
        lit = {uid for uid in wanted - own if changes.get(uid, 0.0) > settings.tolerance}
        uids, notes = own | lit, _notes(lit, set(changes) - own - lit, settings.tolerance)
    if not uids:
        raise NothingChangedError
    return ChangedObjects(uids, changes, (*_named(_CHANGED, own), *notes))


def remember_light(
    scene: bpy.types.Scene, read: ReadScene, baked: set[int], changed: ChangedObjects | None
) -> None:
    """Write down what a bake of all objects, or of changed ones, leaves to the next bake of changed ones.

    read   all that was read
    baked  session uids of the objects that were baked
    """
    if changed is not None and changed.changes is None:
        scene.hemibake.baked_scene = ""
        return
    scene.hemibake.baked_scene = baked_scenes.keep(read)
    changes = {} if changed is None or changed.changes is None else changed.changes
    _write(scene, {**changes, **dict.fromkeys(baked, 0.0)})


def forget_light(scene: bpy.types.Scene, baked: set[int]) -> None:
    """Have the next bake of changed objects bake those that were baked in another scene than is known."""
    _write(scene, dict.fromkeys(baked, ALL_LIGHT))


def _changes(
    read: ReadScene,
    settings: Settings,
    bake: Callable[[Scene, Settings], Bake],
    stages: RunStages,
    known: str,
) -> Generator[Progress | None, None, dict[int, float] | None]:
    """Return how much the light of each object has changed since the last bake; None if that is not known.

    Neither is it for shadow masks, nor for maps of light groups that the last bake did not make.
    """
    scene, quick = baked_scenes.find(known), comparison_settings(settings)
    if scene is None or not tells_all(settings, scene, read.scene):
        return None
    try:
        whole = before = yield from stages.include(stages.before, bake(scene, quick))
        lamps = differing_lights(scene, read.scene)
        if lamps is not None:
            before = yield from stages.include(stages.lamps, bake(lamps[0], quick))
        now = yield from stages.include(stages.now, bake(lamps[1] if lamps else read.scene, quick))
    except OverlapError:
        return None
    return light_changes(read, QuickBakes(whole, before, now))


def _notes(lit: set[int], left: set[int], tolerance: float) -> list[str]:
    """Return sentences on the objects whose light has changed, and on those that stay as they were."""
    limit = f"{100 * tolerance:g} %"
    return [
        *_named(f"Baked since their light can have changed by more than {limit}: {{}}.", lit),
        *_named(f"Left as they were, since their light has changed by no more than {limit}: {{}}.", left),
    ]


def _named(sentence: str, uids: set[int]) -> list[str]:
    """Return a sentence with the names of objects, none without objects."""
    names = [obj.name for obj in bpy.data.objects if obj.session_uid in uids]
    return [object_message(sentence, names)] if names else []


def _write(scene: bpy.types.Scene, changes: dict[int, float]) -> None:
    """Write on objects how much their light may have changed since they were baked."""
    for obj in bpy.data.objects:
        if obj.session_uid in changes and obj.is_editable:
            writable_record(obj, scene).light_change = min(changes[obj.session_uid], ALL_LIGHT)
