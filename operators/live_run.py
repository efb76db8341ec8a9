"""A bake that goes on: its lightmaps follow the scene until it is ended."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import bpy

from ..engine.bake_result import BakeResult
from ..engine.errors import EngineError
from ..engine.postprocess.output_names import output_names
from ..engine.progress import Progress, finished
from ..engine.scene.model import Scene
from ..engine.scene.scene_changes import changes_between
from ..engine.settings import Settings
from .bake_run import ATTEMPTS, Bake, BakeRun, Steps
from .bake_settings import read_settings
from .live_watch import LiveWatch
from .lookup import find_all
from .result.preview import refresh_preview
from .result.progress_images import image_names
from .scene import SceneChangedError, read_lamps, read_moved, read_scene, store_edits, visible_meshes
from .scene.objects.render_differences import uses_render
from .scene.units import texels_per_unit
from .scene.uvs.uv_modifier import has_uvs
from .worker_manager import owner

#: What is shown while the worker has nothing to do.
RESTING = Progress("Live", 1.0, 1.0)

#: Time between two looks at the settings, s: they take a third of a millisecond.
_LOOKS = 0.25

#: A scene of no more triangles is read at once. Others, which the timeline changes in each frame, are read
#: in one piece in the end, for which the window stops.
_FEW = 50_000

#: Does what the engine does for a scene that is followed.
_LIVE = "engine.session:live"


class LiveRun(BakeRun):
    """A `BakeRun` whose lightmaps are finished again and again: `finish` stores those of the last time.

    lightmap  what was finished last; None before the first bake has come to its end
    resting   True while the worker has nothing to do
    ending    True once changes are not taken over any more
    outdated  True once it has to begin anew: somebody has chosen other settings, or the scene has other
              lightmaps or light groups than it has begun with
    """

    def __init__(self, context: bpy.types.Context, made_uvs: Callable[[], None] = lambda: None) -> None:
        super().__init__(context, self._first_bake, made_uvs=made_uvs)
        self._watch = LiveWatch(self._context, self._store_shown, self._has_stored)
        self._followed: Generator[Progress | BakeResult | None, None, None] | None = None
        self.lightmap: BakeResult | None = None
        self.resting = self.ending = self.outdated = self._guessed = False
        self._shown = True
        self._paths: dict[int, str] = {}
        self._begun_with, self._next_look = self._chosen_settings(), 0.0

    def _chosen_target(self) -> str:
        """Return "ALL": a change may alter the light of everything."""
        return "ALL"

    def _first_bake(self, scene: Scene, settings: Settings) -> Bake:
        """Bake until the light has settled for the first time, and leave the worker at it."""
        self._stop_following()
        self._sent = scene
        self._followed = owner.worker().follow(_LIVE, scene, settings, dict(owner.paces))
        while True:
            step = next(self._followed)
            if isinstance(step, BakeResult):
                return step
            yield step

    def begin_following(self, lightmap: BakeResult) -> dict:
        """Store the lightmaps of the first bake, watch the scene, and return the report; see `finish`."""
        self._take(lightmap)
        report = self.finish(lightmap)
        self._hold_pixels()
        self._watch.begin()
        self._work = self._following()
        return report

    def _hold_pixels(self) -> None:
        """Pack the images: of those in files Cycles shows the files, not the pixels that follow the scene."""
        for image in find_all(bpy.data.images, self._images.uids):
            if image.packed_file is None:
                image.pack()

    def _store_shown(self, path: str = "", *_: object) -> None:
        """Store what was finished last, for a file that is about to be saved; see `_hold_pixels`.

        path: of that file; under another name than before it has lightmaps of its own
        """
        targets = find_all(bpy.data.images, self._images.uids)
        if len(targets) == len(self._names):
            with suppress(EngineError):
                self._paths = {image.session_uid: image.filepath_raw for image in targets}
                if path and path != bpy.data.filepath:
                    self._destination = self._destination_of(path)
                self._store(targets, self._show_finished(self.lightmap), self.lightmap)

    def _has_stored(self, path: str = "", *_: object) -> None:
        """Go on after a file was saved; with the lightmaps of the file before, if it was but a copy."""
        self._hold_pixels()
        if path and path != bpy.data.filepath:
            with suppress(EngineError):
                self._destination = self._destination_of(bpy.data.filepath)
            self._name_as_before()

    def _name_as_before(self) -> None:
        """Give the images the paths that they had before a copy of the file was saved."""
        for image in find_all(bpy.data.images, self._paths):
            image.filepath_raw = self._paths[image.session_uid]
            for packed in image.packed_files:
                packed.filepath = image.filepath_raw

    def _following(self) -> Bake:
        """Take over what changes, and show what the worker makes of it."""
        while True:
            if time.perf_counter() > self._next_look:
                self.outdated |= self._chosen_settings() != self._begun_with
                self._next_look = time.perf_counter() + _LOOKS
            if self._shown or self.resting:
                yield from self._send_changes()
            step = next(self._followed)
            if isinstance(step, BakeResult):
                self._take(step)
                self._show_finished(step)
                yield RESTING
            elif step is not None:
                if step.intermediate is not None:
                    self._images.show(step.intermediate)
                    self._shown = True
                yield step
            else:
                yield None

    def _chosen_settings(self) -> tuple:
        """Return what decides how the scene is baked; raises SettingsError."""
        chosen = self._context.scene.hemibake
        width = chosen.size_mode, texels_per_unit(chosen), chosen.largest_width
        return replace(read_settings(chosen), centres=False), chosen.uv_layer, *width

    def _take(self, lightmap: BakeResult) -> None:
        """Take the finished lightmap of the scene that was sent last."""
        self.lightmap, self.resting, self._took = lightmap, True, time.perf_counter() - self._start
        self._of_lightmap = self._read

    def _send_changes(self) -> Steps:
        """Send what has changed.

        Nothing is read before what was sent last shows, so that there is light however long reading takes.
        """
        takes, waits = not (self.ending or self.outdated or self.undone), self._waits
        if takes and self._watch.objects and not waits:
            yield from self._send(True)
        elif takes and self._watch.moved and not waits:
            # Meshes of renders are read when the light has settled: each reading stops the window.
            yield from self._send(not uses_render(self._context))
        elif takes and self._watch.lamps:
            yield from self._send(False)
        elif self.resting and self._guessed and not waits:
            yield from self._send(True)

    @property
    def _waits(self) -> bool:
        """True while lamps alone are read: the scene is a large one, and the timeline plays."""
        return self._read.triangles > _FEW and _timeline_plays()

    def _send(self, everything: bool) -> Steps:
        """Read the scene, or only its lamps and where objects are; send the worker what is other than it was.

        What these change is read at once; all else is read again when the light has settled.
        """
        moved = frozenset[int]() if self._waits else frozenset(self._watch.moved)
        if everything:
            refresh_preview(
                self._context.scene, self._context.evaluated_depsgraph_get(), self._watch.materials
            )
            store_edits(self._context, self._baked())
            self._watch.clear()
        self._watch.clear_moves()
        moves = partial(self._reading_moves, moved)
        if not (yield from self._settled_reading(self._reading if everything else moves)):
            self._watch.objects = True
            return
        self._guessed = not everything
        scene = self._read.scene
        if image_names(scene.atlases, output_names(scene, self._settings)) != self._names:
            self.outdated = True
            return
        changes = changes_between(self._sent, scene)
        if changes is None or not changes.empty:
            owner.worker().update(scene if changes is None else changes)
            self._start, self.resting, self._shown = time.perf_counter(), False, False
        elif self.resting:
            # An undo may have brought older pixels.
            self._of_lightmap = self._read
            self._show_finished(self.lightmap)
        self._sent = scene

    def _settled_reading(self, read: Callable[[bool], Steps]) -> Generator[Progress | None, None, bool]:
        """Read; again if somebody changes the scene meanwhile, and in the end in one piece.

        Returns False if it was given up: the timeline has begun to play, and only lamps are read then.
        """
        for _ in range(ATTEMPTS):
            try:
                for step in read(False):
                    yield None if step is None else RESTING
            except SceneChangedError:
                if read == self._reading and self._waits:
                    return False
                yield None
            else:
                return True
        finished(read(True))
        return True

    def _reading(self, hurried: bool) -> Steps:
        """Read the scene, with lightmaps for the objects that have lightmap UVs."""
        where = (self._context, self._baked(), self._uv_layer, self._settings.resolution)
        self._read = yield from read_scene(*where, (), owner.paces, hurried, edits_stored=True)

    def _baked(self) -> list[bpy.types.Object]:
        """Return the objects that get a lightmap: those with lightmap UVs."""
        return [obj for obj in visible_meshes(self._context) if has_uvs(obj, self._uv_layer)]

    def _reading_moves(self, moved: frozenset[int], hurried: bool) -> Steps:
        """Read the lamps and where objects are that have moved, and take all else as it was."""
        scene = yield from read_lamps(self._context, self._read.scene, hurried)
        self._read = replace(self._read, scene=scene)
        if moved:
            read = read_moved(self._context, self._read, moved)
            self._watch.objects |= read is None
            self._read = read or self._read

    @property
    def undone(self) -> bool:
        """True once somebody has undone that it began."""
        return self._watch.undone

    @property
    def settled(self) -> bool:
        """True while there is nothing to do, or nothing but changes that are not taken over any more."""
        guessed = self._guessed and not (self.ending and self._waits)
        return self.resting and not guessed and (self.ending or not self._watch.changed)

    def keep(self) -> dict:
        """End, store the lightmaps that were finished last, and return the report.

        What is remembered of the scene is as it was when they were: it may have been read again since. Their
        time is that from the last change until they were finished.
        """
        self._end()
        self._start = time.perf_counter() - self._took
        self._read = self._whole = self._of_lightmap
        return self.finish(self.lightmap)

    def cancel(self, keep_images: bool = False) -> bool:
        """End; before the first bake has come to its end take everything back, see `BakeRun.cancel`.

        Afterwards everything stays: it is as after a bake.
        """
        self._end()
        return super().cancel(keep_images) if self.lightmap is None else True

    def _end(self) -> None:
        """Watch and follow no more."""
        self._watch.end()
        self._work.close()
        self._stop_following()

    def _stop_following(self) -> None:
        if self._followed is not None:
            self._followed.close()
            self._followed = None


def _timeline_plays() -> bool:
    """Return whether some window plays the timeline."""
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)
