"""Live bake: its lightmaps follow the scene until it is ended."""

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
from ..engine.scene.scene_changes import changes_between, same_probe_volumes
from ..engine.settings import Settings
from .bake_run import ATTEMPTS, Bake, BakeRun, Steps
from .bake_settings import read_settings
from .live_watch import LiveWatch
from .lookup import find_all
from .preview_switch import follow_again
from .result.images import pack_for_bake
from .result.preview import refresh_preview
from .result.probe_images import update_probes
from .result.progress_images import image_names
from .result.rec709_result import in_rec709
from .scene import SceneChangedError, read_lamps, read_moved, read_scene, store_edits, visible_meshes
from .scene.objects.render_differences import uses_render
from .scene.units import texels_per_unit
from .scene.uvs.uv_modifier import has_uvs
from .worker_manager import owner
from .working_space import to_rec709

#: Progress that the window shows while the worker is idle.
RESTING = Progress("Live", 1.0, 1.0)

#: Time between two reads of the settings, s, chosen; a read takes 0.3 ms.
_LOOKS = 0.25

#: Maximum number of triangles of a scene that is read again in each frame while the timeline plays. Larger
#: scenes would stall the window; they are read when the timeline stops.
_FEW = 50_000

#: Function of the engine that the worker runs for Live.
_LIVE = "engine.session:live"


class LiveRun(BakeRun):
    """`BakeRun` that finishes its lightmaps after each change; `finish` stores the last ones.

    lightmap  last finished lightmaps; None before the end of the first bake
    resting   True while the worker is idle
    ending    True if further changes are ignored
    outdated  True if a new run must replace it, because settings, lightmaps or light groups have changed
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

    def _read_settings(self) -> Settings:
        """Return the settings of the scene without reflection cubes, which Live does not bake."""
        return replace(super()._read_settings(), reflection_cubes=False)

    def _check_suns(self) -> None:
        """Check nothing: Live bakes no sun path."""

    def _place_suns(self) -> None:
        """Leave the sun where it is: Live shows the scene as it is now."""

    def _chosen_target(self) -> str:
        """Return "ALL", since a change may affect the light of all objects."""
        return "ALL"

    def _first_bake(self, scene: Scene, settings: Settings) -> Bake:
        """Bake until the light has converged for the first time; the worker then waits for changes."""
        self._stop_following()
        self._sent = scene
        self._followed = owner.worker().follow(_LIVE, scene, settings, dict(owner.paces))
        while True:
            step = next(self._followed)
            if isinstance(step, BakeResult):
                return step
            yield step

    def begin_following(self, lightmap: BakeResult) -> dict:
        """Store the lightmaps of the first bake, start watching the scene, and return the report."""
        self._take(lightmap)
        report = self.finish(lightmap)
        self._hold_pixels()
        self._watch.begin()
        self._work = self._following()
        return report

    def _hold_pixels(self) -> None:
        """Pack the images, because Cycles would display the files instead of the updated pixels."""
        for image in find_all(bpy.data.images, self._pictures.uids):
            if image.packed_file is None:
                pack_for_bake(image)

    def _store_shown(self, path: str = "", *_: object) -> None:
        """Write the lightmap files when the .blend is saved; between saves the images are packed.

        They are stored with the scene of the lightmaps, since it may have been read again.

        path: path of the .blend; a file with a new name gets its own lightmaps
        """
        assert self.lightmap is not None
        targets, last_read = find_all(bpy.data.images, self._pictures.uids), self._read
        if len(targets) != len(self._names):
            return
        self._read = self._of_lightmap
        try:
            with suppress(EngineError):
                self._paths = {image.session_uid: image.filepath_raw for image in targets}
                if path and path != bpy.data.filepath:
                    self._destination = self._destination_of(path)
                lightmap = in_rec709(self.lightmap)
                self._store(targets, self._show_finished(lightmap), lightmap)
        finally:
            self._read = last_read

    def _has_stored(self, path: str = "", *_: object) -> None:
        """Pack the images again after a save. If only a copy was saved, restore their paths."""
        self._hold_pixels()
        if path and path != bpy.data.filepath:
            with suppress(EngineError):
                self._destination = self._destination_of(bpy.data.filepath)
            self._name_as_before()

    def _name_as_before(self) -> None:
        """Restore the paths that the images had before a copy of the .blend was saved."""
        for image in find_all(bpy.data.images, self._paths):
            image.filepath_raw = self._paths[image.session_uid]
            for packed in image.packed_files:
                packed.filepath = image.filepath_raw

    def _following(self) -> Bake:
        """Send changes of the scene to the worker and show its lightmaps, until closed."""
        while True:
            if time.perf_counter() > self._next_look:
                self.outdated |= self._chosen_settings() != self._begun_with
                self._next_look = time.perf_counter() + _LOOKS
            if self._shown or self.resting:
                yield from self._send_changes()
            assert self._followed is not None
            step = next(self._followed)
            if isinstance(step, BakeResult):
                self._take(step)
                lightmap = in_rec709(step)
                self._show_finished(lightmap)
                update_probes(self._context.scene, lightmap.probes)
                yield RESTING
            elif step is not None:
                if step.intermediate is not None:
                    self._pictures.show(to_rec709(step.intermediate))
                    self._shown = True
                yield step
            else:
                yield None

    def _chosen_settings(self) -> tuple:
        """Return all settings that require a new run when they change; raises SettingsError."""
        chosen = self._context.scene.hemibake
        width = chosen.size_mode, texels_per_unit(chosen), chosen.largest_width
        settings = replace(read_settings(chosen), centres=False, reflection_cubes=False)
        return settings, chosen.uv_layer, *width

    def _take(self, lightmap: BakeResult) -> None:
        """Store the finished lightmaps of the last sent scene."""
        self.lightmap, self.resting, self._took = lightmap, True, time.perf_counter() - self._start
        self._of_lightmap = self._read

    def _send_changes(self) -> Steps:
        """Read changed data of the scene and send it to the worker.

        Call it only after the last sent changes are displayed, so that the display never waits for reading.
        """
        takes, waits = not (self.ending or self.outdated or self.undone), self._waits
        if takes and self._watch.objects and not waits:
            yield from self._send(True)
        elif takes and self._watch.moved and not waits:
            # Reading render meshes stalls the window, so it waits until the light has converged.
            yield from self._send(not uses_render(self._context))
        elif takes and self._watch.lamps:
            yield from self._send(False)
        elif self.resting and self._guessed and not waits:
            yield from self._send(True)

    @property
    def _waits(self) -> bool:
        """Return True while a large scene plays its timeline, when only lights are read."""
        return self._read.triangles > _FEW and _timeline_plays()

    def _send(self, everything: bool) -> Steps:
        """Read the scene, or only lights and transforms, and send the differences to the worker.

        everything  True to read the whole scene; otherwise it is read again when the light has converged
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
        new_names = image_names(scene.atlases, output_names(scene, self._settings)) != self._names
        if new_names or not same_probe_volumes(scene, self._sent):
            self.outdated = True
            return
        changes = changes_between(self._sent, scene)
        if changes is None or not changes.empty:
            owner.worker().update(scene if changes is None else changes)
            self._start, self.resting, self._shown = time.perf_counter(), False, False
        elif self.resting:
            # An undo may have restored older pixels.
            self._of_lightmap = self._read
            assert self.lightmap is not None
            self._show_finished(in_rec709(self.lightmap))
        self._sent = scene

    def _settled_reading(self, read: Callable[[bool], Steps]) -> Generator[Progress | None, None, bool]:
        """Read the scene in slices; repeat if it changes meanwhile, the last time without interruption.

        Returns False if reading was stopped because a large scene plays its timeline.
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
        """Read the whole scene; objects with lightmap UVs get lightmaps."""
        where = (self._context, self._baked(), self._uv_layer, self._settings.resolution)
        self._read = yield from read_scene(*where, (), owner.paces, hurried, edits_stored=True)

    def _baked(self) -> list[bpy.types.Object]:
        """Return the visible objects with lightmap UVs, which get lightmaps."""
        return [obj for obj in visible_meshes(self._context) if has_uvs(obj, self._uv_layer)]

    def _reading_moves(self, moved: frozenset[int], hurried: bool) -> Steps:
        """Read lights and the transforms of moved objects; keep all other data of the last read."""
        scene = yield from read_lamps(self._context, self._read.scene, hurried)
        self._read = replace(self._read, scene=scene)
        if moved:
            read = read_moved(self._context, self._read, moved)
            self._watch.objects |= read is None
            self._read = read or self._read

    @property
    def undone(self) -> bool:
        """True if the start of Live was undone."""
        return self._watch.undone

    @property
    def converged(self) -> bool:
        """True if the light has converged and no changes are left to process."""
        guessed = self._guessed and not (self.ending and self._waits)
        return self.resting and not guessed and (self.ending or not self._watch.changed)

    def keep(self) -> dict:
        """End, store the last finished lightmaps, and return the report.

        The scene of those lightmaps is stored with them, since it may have been read again. The reported time
        is the time from the last change to the end of the lightmaps.
        """
        assert self.lightmap is not None
        self._end()
        self._start = time.perf_counter() - self._took
        self._read = self._whole = self._of_lightmap
        return self.finish(self.lightmap)

    def cancel(self, keep_images: bool = False) -> bool:
        """End; undo everything during the first bake, see `BakeRun.cancel`; keep everything later."""
        self._end()
        return super().cancel(keep_images) if self.lightmap is None else True

    def _end(self) -> None:
        """Stop watching the scene and the work of the worker."""
        self._watch.end()
        self._work.close()
        self._stop_following()
        follow_again()

    def _stop_following(self) -> None:
        if self._followed is not None:
            self._followed.close()
            self._followed = None


def _timeline_plays() -> bool:
    """Return True if any window plays the timeline."""
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)
