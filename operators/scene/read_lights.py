"""Reads the lights again for a scene that was read before."""

from __future__ import annotations

from collections.abc import Generator, Set
from dataclasses import replace

from ...engine.progress import Progress, map_progress
from ...engine.scene.model import Scene
from .invalid_values import replace_invalid_values
from .light.lights import SceneLights
from .objects.evaluation import Evaluation
from .objects.render_differences import is_instancer
from .objects.visible import visible_objects
from .scene_context import SceneContext
from .scene_watch import SceneWatch
from .slice_timer import Slices


def read_lamps(
    context: SceneContext, scene: Scene, hurried: bool = False
) -> Generator[Progress | None, None, Scene]:
    """Return the scene with its current lights, read again; notes about the lights are dropped.

    hurried:  True to accept changes during the reading, see `read_scene`

    Raises SceneChangedError if the scene changes between two slices.
    """
    with SceneWatch(context, hurried) as watch:
        work = _read(watch, scene)
        return (yield from map_progress(work, _progress))


def _progress(said: float | str | None) -> Progress:
    """Convert a step of reading, which is a fraction or an announcement, to a Progress."""
    return Progress(said if isinstance(said, str) else "Reading lamps", 0.0)


def _read(watch: SceneWatch, scene: Scene) -> Slices[Scene]:
    notes: list[str] = []
    lamps = SceneLights(notes)
    sources = [obj for obj in visible_objects(watch.context) if obj.type == "LIGHT" or is_instancer(obj)]
    watch.evaluate(lambda evaluation: _add_lamps(evaluation, watch.visible, lamps), sources)
    suns = (light for light in scene.lights if light.of_world)
    lights = (*(yield from lamps.finish(scene.origin, watch)), *suns)
    return (yield from replace_invalid_values(replace(scene, lights=lights), notes))


def _add_lamps(evaluation: Evaluation, visible: Set[int], lamps: SceneLights) -> None:
    """Read the lights of an evaluation; `visible` has the session uids of objects that renders show."""
    for item in evaluation.items(visible):
        if item.source.type == "LIGHT":
            lamps.add(item)
