"""A bake that follows its scene: changes are taken between steps, and the light goes on from where it was."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace

from .bake_result import BakeResult
from .progress import Progress
from .scene.checks import check_scene
from .scene.model import Scene
from .scene.scene_changes import SceneChanges
from .settings import Settings, check_settings

#: Bakes a scene that has been checked; see `Session.bake`.
Bake = Callable[[Scene, Settings], Generator[Progress, None, BakeResult]]


class Live:
    """The lightmaps of a scene that changes; made by `Session.live`.

    scene     as it is after all changes
    lightmap  the finished bake of it; None while there is something to do
    """

    def __init__(self, bake: Bake, scene: Scene, settings: Settings) -> None:
        """Take what bakes; every patch gathers for itself, since light decides where groups of them end.

        A scheduler is not used: its workers keep nothing from one bake to the next.
        Raises SettingsError, SceneError for what cannot be baked.
        """
        check_settings(settings)
        check_scene(scene)
        self._bake, self.scene = bake, scene
        self._settings = replace(settings, warm_start=True, intermediates=True, adaptive=False, scheduler="")
        self.lightmap: BakeResult | None = None
        self._changed = False

    def update(self, changes: SceneChanges | Scene) -> None:
        """Take changes, or a whole other scene, between two steps of `converge`, or after it.

        What an array holds that was handed over once must not change: other values need another array.
        Raises SceneError for what cannot be baked; then everything stays as it was.
        """
        scene = changes.of(self.scene) if isinstance(changes, SceneChanges) else changes
        check_scene(scene)
        self.scene, self.lightmap, self._changed = scene, None, True

    def converge(self) -> Generator[Progress, None, BakeResult]:
        """Bake until nothing is left to do; yields as `Session.bake`, returns the Lightmap.

        The first image has new direct light, at first by few rays, above the other light of before, if direct
        light has changed; others follow sweeps, but not faster than anybody sees. Changes that come meanwhile
        take effect after the next image, so that there is one however fast they follow each other.
        """
        while self.lightmap is None:
            self._changed = False
            with closing(self._bake(self.scene, self._settings)) as work:
                yield from self._follow(work)
        return self.lightmap

    def _follow(self, work: Generator[Progress, None, BakeResult]) -> Generator[Progress, None, None]:
        """Bake to the end, or to the first image after which the scene is another one."""
        shown = False
        while not (self._changed and shown):
            try:
                progress = next(work)
            except StopIteration as stop:
                self.lightmap = None if self._changed else stop.value
                return
            shown |= progress.intermediate is not None
            yield progress
