"""Objects that a bake of changed objects includes, and the scenes that it stores for the next one."""

from __future__ import annotations

import uuid
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
    detects_every_change,
    differing_lights,
    light_changes,
)
from .working_space import working_space

#: Maximum number of scenes, and of bytes of all scenes. With three, one remains after a bake was undone.
_MOST, _LIMIT = 3, 1 << 29


class SceneSnapshots:
    """Last baked scenes by name; `hemibake.baked_scene` of a Blender scene stores the name."""

    def __init__(self) -> None:
        self._scenes: dict[str, tuple[Scene, int, str]] = {}

    def keep(self, read: ReadScene) -> str:
        """Store a scene, remove the oldest ones if necessary, and return its name; "" if it is too large."""
        size = read.bytes
        while self._scenes and (len(self._scenes) >= _MOST or self._bytes + size > _LIMIT):
            del self._scenes[next(iter(self._scenes))]
        if size > _LIMIT:
            return ""
        name = uuid.uuid4().hex
        self._scenes[name] = read.scene, size, working_space()
        return name

    def find(self, name: str) -> Scene | None:
        """Return the scene with a name; None if it is not stored or was read in another working space."""
        scene, _, space = self._scenes.get(name, (None, 0, ""))
        return scene if space == working_space() else None

    def clear(self) -> None:
        """Remove all scenes."""
        self._scenes.clear()

    @property
    def _bytes(self) -> int:
        return sum(size for _, size, _ in self._scenes.values())


#: The only instance.
baked_scenes = SceneSnapshots()


Bake = Generator[Progress | None, None, BakeResult]

#: Reasons in the report for baking an object: own changes, or lights that changed by an unknown amount.
_CHANGED = "{}: baked, because they are new or their shape, place or materials have changed."
_LIGHTS_DIFFER = "{}: baked, because lights, emissive objects or the world have changed."

#: Warning about other objects if the change of light is unknown.
_OTHERS_STAY = (
    "Only changed objects were baked, so other objects lack their new shadows and reflected light. Bake all "
    "objects at the end."
)


@dataclass(frozen=True)
class ChangedObjects:
    """Objects to bake, and the reasons.

    uids     session uids of the objects
    changes  relative change of light of each object since its last bake, by session uid; None if unknown
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
    """Return the objects whose own data or light has changed since they were baked.

    wanted  session uids of the candidates
    bake    function that runs the low-sample comparison bakes
    scene   Blender's scene, which stores the name of the scene of its last bake, see SceneSnapshots

    Raises NothingChangedError if no object has changed.
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
    """Store the baked scene and the changes of light, for comparison by the next bake of changed objects.

    read     the whole scene
    baked    session uids of the objects that were baked
    changed  result of `find_changed_objects`; None after a bake of all objects
    """
    if changed is not None and changed.changes is None:
        scene.hemibake.baked_scene = ""
        return
    scene.hemibake.baked_scene = baked_scenes.keep(read)
    changes = {} if changed is None or changed.changes is None else changed.changes
    _write(scene, {**changes, **dict.fromkeys(baked, 0.0)})


def forget_light(scene: bpy.types.Scene, baked: set[int]) -> None:
    """Mark objects as changed, so that the next bake of changed objects includes them."""
    _write(scene, dict.fromkeys(baked, ALL_LIGHT))


def _changes(
    read: ReadScene,
    settings: Settings,
    bake: Callable[[Scene, Settings], Bake],
    stages: RunStages,
    known: str,
) -> Generator[Progress | None, None, dict[int, float] | None]:
    """Measure the relative change of light of each object, by session uid; None if it is unknown.

    It is unknown without a stored scene, and for outputs that comparison bakes cannot compare, see
    `detects_every_change`.
    """
    scene, quick = baked_scenes.find(known), comparison_settings(settings)
    if scene is None or not detects_every_change(settings, scene, read.scene):
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
    """Return sentences about objects whose light has changed, and about objects that are not baked."""
    limit = f"{100 * tolerance:g} %"
    return [
        *_named(f"{{}}: baked, because their light may have changed by more than {limit}.", lit),
        *_named(f"{{}}: not baked, because their light has changed by at most {limit}.", left),
    ]


def _named(sentence: str, uids: set[int]) -> list[str]:
    """Return a list with the sentence, in which {} is replaced by the objects' names.

    Empty without objects.
    """
    names = [obj.name for obj in bpy.data.objects if obj.session_uid in uids]
    return [object_message(sentence, names)] if names else []


def _write(scene: bpy.types.Scene, changes: dict[int, float]) -> None:
    """Store the relative changes of light in the objects' records of a scene."""
    for obj in bpy.data.objects:
        if obj.session_uid in changes and obj.is_editable:
            writable_record(obj, scene).light_change = min(changes[obj.session_uid], ALL_LIGHT)
