"""One bake: read the scene, bake, store the lightmaps. Operators call its steps."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from dataclasses import replace

import bpy
import numpy as np

from ..engine.bake_result import BakeResult
from ..engine.errors import EngineError, OverlapError, SceneError
from ..engine.object_message import object_message
from ..engine.outputs import LIGHT_GROUP
from ..engine.plan.stages import Extent
from ..engine.postprocess.output_names import output_names
from ..engine.postprocess.reduced_groups import reduce_groups
from ..engine.progress import Progress, finished, map_progress
from ..engine.scene.light_groups import light_group_names
from ..engine.scene.model import Scene
from ..engine.scene.sun_path import without_sun_positions
from ..engine.settings import Settings
from .bake_report import bake_report
from .bake_settings import read_settings
from .changed_objects import ChangedObjects, find_changed_objects, forget_light, remember_light
from .check import Finding
from .checks import IdleCheck, forget_moved_charts, last_check
from .file_format import chosen_format
from .handlers import Handlers
from .lightmap_size import choose_width, settle_width
from .lookup import find
from .preview_switch import follow_again
from .result import images
from .result.baked_marks import mark_lightmaps, mark_objects
from .result.clipping import clipping_notes
from .result.contents import chosen_names, lightmap_contents
from .result.destination import Destination, choose_destination
from .result.level_maps import mark_levels, store_levels
from .result.light_overlay import LightOverlay
from .result.light_states import manifest_states
from .result.preserved_texels import PreservedTexels
from .result.preview import renew_preview, show_preview, shows_preview
from .result.probe_files import probe_files
from .result.probe_images import keep_probes
from .result.progress_images import ProgressImages, image_names
from .result.rec709_result import in_rec709
from .result.reflection_files import reflection_files
from .result.sun_states import mark_sun_maps, path_report, store_sun_states
from .result.vertex_light import store_vertex_light
from .rollback import Rollback
from .run_stages import RunStages
from .scene import SceneChangedError, SceneContext, read_scene, visible_meshes
from .scene.bake_targets import only_targets, target_uids
from .scene.overlaps import without_overlaps
from .scene.probe_volumes import count_probes
from .scene.reflection_spheres import count_spheres
from .scene.sun_path import SunPath, check_sun_path, place_suns, sun_times
from .scene.uvs.unwrap import unwrap_missing
from .scene.uvs.uv_modifier import UvSnapshot, has_uvs
from .user_files import keep_paces
from .worker_manager import owner
from .working_space import to_rec709

#: Attempts to read the scene in slices while it changes; the next attempt reads it in one piece.
ATTEMPTS = 3

#: Note for a sun path that is not baked.
_NO_GROUPS = (
    "Sun Path: the output Light Groups is off, so the path is not baked. Turn it on, or empty the times."
)

Bake = Generator[Progress | None, None, BakeResult]
Steps = Generator[Progress | None, None, None]


class BakeRun:
    """A bake of the context's scene; its changes can be undone until `finish` returns.

    All work, including reading the scene, is done by `step`. A caller that gets an exception from it must
    call `cancel`.

    bake:        the engine's bake function, or one that bakes in a worker
    watched:     False to show no intermediate lightmaps
    made_uvs:    called after lightmap UVs were made; it must add an undo step before anything else happens
    in_worker:   True if `bake` bakes in a worker, which then maps the meshes that this process reads
    findings:    findings of the check of the scene, once it is finished
    failure:     reason why the lightmaps could not be written; None if they were
    uvs_undone:  True if an undo removed the lightmap UVs of all objects to bake, so that the bake is useless
    """

    def __init__(
        self,
        context: bpy.types.Context,
        bake: Callable[[Scene, Settings], Bake],
        watched: bool = True,
        made_uvs: Callable[[], None] = lambda: None,
        in_worker: bool = False,
    ) -> None:
        self._context, self._bake, self._in_worker = SceneContext(context), bake, in_worker
        self._watched, self._made_uvs = watched, made_uvs
        self._changes = Rollback()
        self._images: ProgressImages | None = None
        self._check: IdleCheck | None = None
        self._overlay = LightOverlay(self._context)
        self._unwraps = False
        self._changed: ChangedObjects | None = None
        self._levels: dict[int, int] = {}
        self._sun_path: SunPath | None = None
        self.findings: tuple[Finding, ...] = ()
        self.failure: str | None = None
        self.uvs_undone = False
        self._start = time.perf_counter()
        self._stages = RunStages(owner.paces, owner.preparation_seconds)
        self._work = self._all_work()

    @property
    def _pictures(self) -> ProgressImages:
        """Images of the lightmaps, once the scene has been read."""
        assert self._images is not None
        return self._images

    def step(self) -> Progress | None:
        """Do a slice of work, return the progress of the run; raises StopIteration(BakeResult) at the end.

        Colors of the result are in the working space. None means that the run waits for the window to be
        drawn, or for the worker.
        """
        progress = next(self._work)
        self._overlay.step()
        if progress is None and self._check is not None:
            self._check.step()
        return progress

    def _all_work(self) -> Bake:
        """Unwrap, read and bake; yield None before saving, so that a window can show that saving is next."""
        yield from self._read_scene()

        # In a window the scene is checked while the worker bakes, else before the bake.
        self._check = IdleCheck(self._context)
        yield self._stages.begin(self._stages.baking)
        if not self._watched:
            yield from self._finish_check()
        with self._overlay:
            if self._watched:
                self._overlay.begin(self._read, self._settings.resolution)
            lightmap = yield from self._bake_without_overlaps()
            yield self._stages.begin(self._stages.saving)
            yield from self._finish_check()
            yield None
        return lightmap

    def _read_scene(self) -> Steps:
        """Unwrap and read the scene, again if it changes in between."""
        scene = self._context.scene
        self._settings = self._read_settings()
        self._uv_layer = scene.hemibake.uv_layer
        self._target = self._chosen_target()
        self._check_suns()
        targets = target_uids(self._context, self._target)
        wanted = {
            obj.session_uid: obj.name for obj in visible_meshes(self._context) if obj.session_uid in targets
        }
        for _ in range(ATTEMPTS):
            try:
                yield from self._unwrap_and_read(wanted)
                break
            except SceneChangedError:
                yield None
        else:
            finished(self._unwrap_and_read(wanted, hurried=True))
        self._seconds = {"read": time.perf_counter() - self._start}
        yield from self._choose_targets(set(wanted))
        self._choose_destination()

    def _read_settings(self) -> Settings:
        """Return the settings of the scene for this run; raises SettingsError."""
        chosen = read_settings(self._context.scene.hemibake)
        return replace(chosen, intermediates=self._watched, centres=False)

    def _chosen_target(self) -> str:
        """Return the scene's setting of the objects to bake."""
        return self._context.scene.hemibake.target

    def _unwrap_and_read(self, wanted: dict[int, str], hurried: bool = False) -> Steps:
        """Make missing lightmap UVs, then read the visible objects.

        wanted:  session uids and names of the objects that get a lightmap
        """
        context, layer = self._context, self._uv_layer
        size = yield from choose_width(context, visible_meshes(context), self._changes)
        resolution = size.width
        objects = [obj for obj in visible_meshes(context) if obj.session_uid in wanted]
        self._foresee(objects, resolution)
        work = unwrap_missing(context, objects, layer, resolution, self._changes, movable=objects)
        made = yield from self._stages.include(self._stages.unwrapping, work)
        if made.objects:
            self._unwraps = True
            self._made_uvs()
        skipped = {obj.session_uid for obj in made.skipped}
        visible = {obj.session_uid: obj for obj in visible_meshes(context)}
        usable = [
            obj
            for uid, obj in visible.items()
            if uid not in skipped and (uid in wanted or has_uvs(obj, layer))
        ]
        self._uvs = UvSnapshot(usable, layer)
        notes = [
            *size.notes,
            *made.notes,
            *_missing([name for uid, name in wanted.items() if uid not in visible]),
        ]
        reading = read_scene(
            context, usable, layer, resolution, notes, owner.paces, hurried, shared=self._in_worker
        )
        self._read = yield from self._stages.include(self._stages.reading, reading)
        whole = self._target == "ALL"
        size = settle_width(self._read.scene, context, size, self._unwraps, whole, self._changes)
        self._read = replace(self._read, notes=(*self._read.notes, *size.notes))
        self._settings = replace(self._settings, resolution=size.width)
        self._place_suns()

    def _check_suns(self) -> None:
        """Raise SceneError or SettingsError if the scene has an invalid sun path."""
        if self._settings.by_light_groups:
            check_sun_path(self._context, self._target)

    def _place_suns(self) -> None:
        """Replace the sun by its positions if the scene has a sun path; raises SceneError, SettingsError."""
        scene = self._context.scene
        if not self._settings.by_light_groups:
            notes = [_NO_GROUPS] if scene.hemibake.sun_times.strip() else []
            self._read = replace(self._read, notes=(*self._read.notes, *notes))
        elif times := sun_times(scene.hemibake.sun_times):
            self._read, self._sun_path = place_suns(self._read, self._context, times, self._target)

    def _foresee(self, objects: Sequence[bpy.types.Object], resolution: int) -> None:
        """Set the approximate amounts of work in the progress before the scene is read."""
        atlases = len({obj.hemibake.atlas for obj in objects})
        lamps = sum(obj.type == "LIGHT" for obj in self._context.view_layer.objects)
        triangles = 2 * sum(len(obj.data.polygons) for obj in objects)
        faces = sum(len(obj.data.polygons) for obj in objects if not has_uvs(obj, self._uv_layer))
        settings = replace(self._settings, resolution=resolution)
        probes, cubes = count_probes(self._context), count_spheres(self._context)
        self._stages.foresee(Extent(atlases, triangles, lamps, probes=probes, cubes=cubes), faces, settings)

    def _choose_targets(self, wanted: set[int]) -> Steps:
        """Select the objects to bake by the target; raises SceneError if there is none."""
        self._whole, self._changed = self._read, None
        if self._target == "CHANGED":
            self._changed = yield from find_changed_objects(
                self._read, wanted, self._settings, self._bake, self._stages, self._context.scene
            )
            wanted = self._changed.uids
            self._read = replace(self._read, notes=(*self._read.notes, *self._changed.notes))
        self._read = only_targets(self._read, wanted, self._context.scene)

    def _choose_destination(self) -> None:
        """Choose the images and files of the lightmaps; raises EngineError if they cannot be written."""
        atlases, outputs = self._read.scene.atlases, output_names(self._read.scene, self._settings)
        self._names = image_names(atlases, outputs)
        self._destination = self._destination_of(bpy.data.filepath)
        partial = self._target != "ALL"
        self._kept = PreservedTexels(self._context, self._read, self._names, self._settings, partial)
        self._images = ProgressImages(
            self._context, atlases, self._names, self._settings.resolution, self._kept, self._changes
        )
        self._stages.expect(self._read.scene, self._settings, len(self._names))

    def _destination_of(self, blend: str) -> Destination:
        """Return the lightmaps' destination for a path of the .blend; raises EngineError if invalid."""
        scene, read = self._context.scene, self._read.scene
        properties, resolution = scene.hemibake, self._settings.resolution
        atlases, outputs = read.atlases, output_names(read, self._settings)
        chosen = chosen_names(properties.file_name, scene, atlases, outputs, resolution, blend)
        formats = [chosen_format(properties).of(output) for output in outputs for _ in atlases]
        return choose_destination(
            scene, self._names, properties.directory, self._changes, formats, chosen, blend
        )

    def _bake_without_overlaps(self) -> Bake:
        """Bake; if charts overlap, bake again without the overlapping objects."""
        with Handlers({"undo_post": self._note_undo, "redo_post": self._note_undo}):
            while True:
                work = self._showing(self._bake(self._read.scene, self._settings))
                try:
                    return (yield from self._stages.include(self._stages.baking, work))
                except OverlapError as error:
                    self._leave_out_overlaps(error)
                    yield None

    def _note_undo(self, *_: object) -> None:
        """Update `uvs_undone`: whether no object to bake is left with its lightmap UVs."""
        baked = set(self._read.fingerprints)
        present = {obj.session_uid for obj in bpy.data.objects}
        self.uvs_undone = not (baked & present) - set(self._uvs.lost())

    def _finish_check(self) -> Steps:
        """Run the check of the scene to its end."""
        assert self._check is not None
        while self._check.step():
            yield self._stages.progress(0.0)
        self._read_findings()

    def _read_findings(self) -> None:
        """Set `findings` to the findings of the scene's last check."""
        checked = last_check(self._context.scene)
        self.findings = () if checked is None else checked.findings

    def _showing(self, work: Bake) -> Bake:
        """Run a bake and show its intermediate lightmaps."""
        pictures = self._pictures

        def shown(progress: Progress | None) -> Progress | None:
            if progress is not None and progress.intermediate is not None:
                self._overlay.show(pictures.show(to_rec709(progress.intermediate)))
            return progress

        return map_progress(work, shown)

    def _leave_out_overlaps(self, error: OverlapError) -> None:
        """Turn objects whose charts overlap others into occluders; raise the error if none is left."""
        usable = without_overlaps(self._read, self._settings.resolution)
        if usable.entries == self._read.entries or not any(usable.entries):
            raise error
        self._read = usable

    def run_to_end(self, show: Callable[[Progress], object] = lambda progress: None) -> BakeResult:
        """Run all steps, show their progress, and return the result of the bake."""
        while True:
            try:
                progress = self.step()
            except StopIteration as end:
                return end.value
            if progress is not None:
                show(progress)

    def cancel(self, keep_images: bool = False) -> bool:
        """Stop the bake, and undo all changes unless images are to be kept.

        Returns True if images are kept; an undo step must then follow.
        """
        kept = keep_images and self._images is not None and bool(self._images.uids)
        try:
            self._work.close()
        finally:
            if kept:
                self._pictures.keep()
            else:
                self._changes.undo()
        return kept

    def finish(self, lightmap: BakeResult) -> dict:
        """Store the lightmaps and return the report, which can be written as JSON; an undo step must follow.

        If the files cannot be written, `failure` is set, and the lightmaps are packed into the .blend.
        """
        start = time.perf_counter()
        lightmap = in_rec709(self._reduce_sun_path(lightmap))
        pixels = self._show_finished(lightmap)
        targets = self._pictures.found()
        lost = self._uvs.lost()
        baked = {entry.uid: entry.place for entry in self._read.objects if entry.uid not in lost}
        self._levels, level_notes = store_levels(self._context, baked, self._settings.resolution)
        files, clipped = self._store(targets, pixels, lightmap)
        self._pictures.keep()
        entries = self._context.scene.hemibake.lightmaps
        mark_lightmaps(entries, lightmap, self._read, self._settings, self._kept)
        self._mark_sun_maps()
        # A bake that could not make probes, for example without OpenCL, keeps the probes of the last bake.
        if self._settings.light_probes and (lightmap.probes or not self._read.scene.probe_volumes):
            keep_probes(self._context.scene, lightmap.probes, self._read.scene.origin)
        mark_objects(self._context.scene, self._read, targets, self._uv_layer, lost)
        mark_levels(self._context.scene, self._levels)
        shown = dict(zip(lightmap.atlases, pixels, strict=False))
        on_vertices, vertex_notes = store_vertex_light(self._context, self._read, shown, lost)
        forget_moved_charts(self._context.scene, self._baked_names(lost))
        self._read_findings()
        self._remember_light(lost)
        self._seconds["store"] = time.perf_counter() - start
        self._stages.has_saved()
        owner.paces.update(lightmap.report.paces)
        keep_paces(owner.paces)
        facts, names = lightmap.report, [image.name for image in targets]
        seconds = {**self._seconds, **facts.seconds, "total": time.perf_counter() - self._start}
        notes = [*self._read.notes, *facts.warnings, *clipped, *vertex_notes, *level_notes]
        notes += self._notes_on_result(lost)
        report = bake_report(self._read, facts, lost, seconds, names, files, notes, on_vertices)
        scene = find(bpy.data.scenes, self._context.scene_uid)
        if scene is not None:
            scene.hemibake.report = json.dumps(report)
        return report

    def update_preview(self) -> None:
        """Update the preview of objects that show their lightmaps; an undo step must follow."""
        with suppress(SceneError):
            if shows_preview(self._context.scene):
                renew_preview(self._context.scene, self._context.evaluated_depsgraph_get())

    def show_lightmaps(self) -> bool:
        """Update or start the preview of lightmaps, by the scene's settings; an undo step must follow.

        Returns True if objects start to show their lightmaps.
        """
        self.update_preview()
        follow_again()
        with suppress(SceneError):
            scene = self._context.scene
            if scene.hemibake.show_when_done and not shows_preview(scene):
                return show_preview(scene, self._context.evaluated_depsgraph_get())[0] > 0
        return False

    def _reduce_sun_path(self, lightmap: BakeResult) -> BakeResult:
        """Return the lightmaps with few maps of the sun path, and store its light states."""
        path, scene = self._sun_path, find(bpy.data.scenes, self._context.scene_uid)
        if path is None or scene is None:
            return lightmap
        reduced = reduce_groups(lightmap, path.names)
        kept = without_sun_positions(self._read.scene, set(path.names) - set(reduced.kept))
        self._read = replace(self._read, scene=kept)
        outputs = output_names(kept, self._settings)
        self._keep_outputs(list(lightmap.passes), outputs)
        others = [name for name in light_group_names(kept) if name not in reduced.kept]
        store_sun_states(scene, path, reduced, others)
        reasons = (*lightmap.report.reasons, path_report(path, reduced))
        passes = {name: reduced.result.passes[name] for name in outputs}
        return replace(reduced.result, passes=passes, report=replace(lightmap.report, reasons=reasons))

    def _mark_sun_maps(self) -> None:
        """Record the maps of the sun path and remove the maps of earlier paths."""
        if self._target != "ALL" or not self._settings.by_light_groups:
            return
        atlases, path = self._read.scene.atlases, self._sun_path
        groups = () if path is None else path.names
        maps = {images.map_name(atlas, f"{LIGHT_GROUP}{group}") for group in groups for atlas in atlases}
        mark_sun_maps(self._context.scene, atlases, self._names, maps)

    def _keep_outputs(self, baked: Sequence[str], outputs: Sequence[str]) -> None:
        """Keep the images and files of some outputs, and make none for the others.

        The destination stays, since a finished bake must not fail with a folder that was changed meanwhile.

        baked:    outputs of the bake in order
        outputs:  outputs to keep, in the same order
        """
        atlases = self._read.scene.atlases
        numbers = [
            baked.index(output) * len(atlases) + atlas for output in outputs for atlas in range(len(atlases))
        ]
        self._names = [self._names[number] for number in numbers]
        self._destination = self._destination.only(numbers)
        self._pictures.limit_to(numbers)
        self._stages.expect(self._read.scene, self._settings, len(numbers))

    def _show_finished(self, lightmap: BakeResult) -> np.ndarray:
        """Copy finished lightmaps to all images; return their pixels, (images, h, w, 3) float32."""
        return self._pictures.show(np.concatenate(list(lightmap.passes.values())))

    def _store(
        self, targets: list[bpy.types.Image], pixels: np.ndarray, lightmap: BakeResult
    ) -> tuple[list[str], list[str]]:
        """Store lightmaps; return the paths of their files, and notes on clipped values."""
        try:
            scene = self._context.scene
            contents = lightmap_contents(
                scene, self._read, self._settings, self._uv_layer, self._kept, self._levels
            )
            baked = self._read.scene
            probes = probe_files(lightmap.probes, baked.origin, self._destination)
            cubes = reflection_files(
                lightmap.reflections, baked.reflection_spheres, baked.origin, self._destination
            )
            states = manifest_states(scene)
            charts = None if any(self._kept.objects()) else lightmap.has_patch
            where = self._destination
            files = images.store(targets, pixels, where, contents, states, probes, cubes, charts)
        except EngineError as error:
            self.failure = str(error)
            return [], []
        notes = clipping_notes(self._read, files[-len(pixels) :], lightmap.has_patch)
        folder, names = self._destination.folder, [file.name for file in files]
        names += [file.name for file in probes] + [file.name for file in cubes]
        return [] if folder is None else [str(folder / name) for name in names], list(notes)

    def _baked_names(self, lost: dict[int, str]) -> set[str]:
        """Return the names of the objects that have new lightmaps."""
        baked = self._read.fingerprints.keys() - lost.keys()
        return {obj.name for obj in bpy.data.objects if obj.session_uid in baked}

    def _remember_light(self, lost: dict[int, str]) -> None:
        """Store the light that the next bake of changed objects is compared with."""
        scene = find(bpy.data.scenes, self._context.scene_uid)
        baked = set(self._read.fingerprints) - set(lost)
        if scene is None:
            return
        if self._target == "SELECTED":
            forget_light(scene, baked)
        else:
            remember_light(scene, self._whole, baked, self._changed)

    def _deleted(self) -> list[str]:
        """Return a list with a note on objects that were deleted during the bake; empty without any."""
        present = {obj.session_uid for obj in self._context.scene.objects}
        baked = dict.fromkeys(entry.uid for entry in self._read.objects)
        names = self._uvs.names(uid for uid in baked if uid not in present)
        sentence = (
            "Deleted during the bake: {}. Other objects still have their shadows and reflected light. "
            "Bake again."
        )
        return [object_message(sentence, names)] if names else []

    def _notes_on_result(self, lost: dict[int, str]) -> list[str]:
        """Return notes on objects that were deleted or lost their UVs, and on lightmaps without files."""
        notes = []
        with suppress(SceneError):
            notes += self._deleted()
        if lost:
            sentence = "Lightmap UVs lost during the bake, for example by an undo: {}. Bake again."
            notes.append(object_message(sentence, list(lost.values())))
        if self._destination.folder is None:
            notes.append(
                "The .blend was not saved, so the lightmaps are packed into it. Save it and bake again to "
                "write files."
            )
        if self._destination.folder is None and self._read.scene.probe_volumes:
            notes.append(
                "Light Probes: the .blend is not saved, so they have no file. Save it and bake again."
            )
        if self._destination.folder is None and self._read.scene.reflection_spheres:
            notes.append(
                "Reflection Cubes: the .blend is not saved, so they have no file. Save it and bake again."
            )
        return notes


def _missing(names: list[str]) -> list[str]:
    """Return a list with a note on objects that were deleted before they were read; empty without any."""
    sentence = "Deleted or hidden while the scene was being read, so not baked: {}."
    return [object_message(sentence, names)] if names else []
