"""Live baking: scene changes between steps, and each bake starts from the last solution."""

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

#: Function that bakes a validated scene, such as `Session.bake`.
Bake = Callable[[Scene, Settings], Generator[Progress, None, BakeResult]]


class Live:
    """Lightmaps of a changing scene; created by `Session.live`.

    scene:     scene after all changes
    lightmap:  finished bake of the scene; None while work is left
    """

    def __init__(
        self, bake: Bake, refresh_backs: Callable[[], bool], scene: Scene, settings: Settings
    ) -> None:
        """Check the scene and adapt the settings; `bake` performs each bake.

        refresh_backs: chooses the visible back faces again, and returns True if the last bake had others

        Adaptive interpolation is off, since the light determines which patches it interpolates. The scheduler
        is off, since its workers keep no data between bakes. Raises SettingsError or SceneError.
        """
        check_settings(settings)
        check_scene(scene)
        self._bake, self._refresh_backs, self.scene = bake, refresh_backs, scene
        self._settings = replace(settings, warm_start=True, intermediates=True, adaptive=False, scheduler="")
        self.lightmap: BakeResult | None = None
        self._changed = False

    def update(self, changes: SceneChanges | Scene) -> None:
        """Apply changes or a new scene, between two steps of `converge` or after it.

        Arrays that were passed once must not be modified; pass a new array for new values. Raises SceneError
        for an invalid scene, and then changes nothing.
        """
        scene = changes.of(self.scene) if isinstance(changes, SceneChanges) else changes
        check_scene(scene)
        self.scene, self.lightmap, self._changed = scene, None, True

    def converge(self) -> Generator[Progress, None, BakeResult]:
        """Bake until no work is left; yield as `Session.bake`, return the `BakeResult`.

        After a change of direct light, the first image combines new direct light from few rays with the
        previous indirect light. Later images follow iterations, limited to the display rate. Changes take
        effect after the next image, so that images appear however fast changes follow. Back faces that moves
        bring into view get patches at the end, so that patches stay while meshes move.
        """
        while self.lightmap is None:
            self._changed = False
            with closing(self._bake(self.scene, self._settings)) as work:
                yield from self._follow(work)
            if self.lightmap is not None and self._refresh_backs():
                self.lightmap = None
        return self.lightmap

    def _follow(self, work: Generator[Progress, None, BakeResult]) -> Generator[Progress, None, None]:
        """Bake to the end, or to the first image after a change."""
        shown = False
        while not (self._changed and shown):
            try:
                progress = next(work)
            except StopIteration as stop:
                self.lightmap = None if self._changed else stop.value
                return
            shown |= progress.intermediate is not None
            yield progress
