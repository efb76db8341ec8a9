"""The lamps of a scene that has been read before."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

from ...engine.progress import Progress, retold
from ...engine.scene.model import Scene
from .faults import without_faults
from .light.lights import Lamps
from .objects.items import scene_items
from .scene_context import SceneContext
from .scene_watch import SceneWatch
from .slices import Slices


def read_lamps(
    context: SceneContext, scene: Scene, hurried: bool = False
) -> Generator[Progress | None, None, Scene]:
    """Return a scene with its lamps as they are now; sentences about them are left to `read_scene`.

    hurried: see `read_scene`. Raises SceneChangedError if the scene changes between two slices.
    """
    with SceneWatch(context, hurried) as watch:
        work = _read(watch, scene)
        return (yield from retold(work, _progress))


def _progress(said: float | str | None) -> Progress:
    """Return what a window shows of a step of reading, which says what comes next if that takes long."""
    return Progress(said if isinstance(said, str) else "Reading lamps", 0.0)


def _read(watch: SceneWatch, scene: Scene) -> Slices[Scene]:
    notes: list[str] = []
    lamps = Lamps(notes)
    for item in scene_items(watch.depsgraph(), watch.visible):
        if item.source.type == "LIGHT":
            lamps.add(item)
    suns = (light for light in scene.lights if light.of_world)
    lights = (*(yield from lamps.finish(scene.origin, watch)), *suns)
    return (yield from without_faults(replace(scene, lights=lights), notes))
