"""Reads the visible objects of a Blender scene as an engine.Scene."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.object_message import first_line, object_message
from ...engine.progress import Progress, finished
from ...engine.scene.model import NO_LIGHTMAP, Mesh, Scene
from ..working_space import is_rec709, working_space
from .fingerprints import combined, find_fingerprints, in_the_world
from .ignored_settings import note_ignored_settings
from .invalid_values import replace_invalid_values
from .light.lights import SceneLights
from .light.world import read_world
from .materials.engine_materials import textures_of
from .materials.material_table import MaterialTable
from .materials.pixels import PixelCache, PixelsNeededError
from .materials.shader_bake import Move
from .messages import Issues
from .objects.evaluation import Evaluation
from .objects.items import SceneItem, scene_items
from .objects.render_differences import uses_render
from .objects.skipped import SkippedItems
from .objects.strands import has_strands
from .probe_volumes import read_probe_volumes
from .read_stages import ReadStages
from .reflection_spheres import read_reflection_spheres
from .scene_context import SceneContext
from .scene_objects import ItemReader, ReadObject
from .scene_watch import SceneWatch
from .slice_timer import Slice, Slices
from .units import metres_per_unit
from .uv_layout import choose_places
from .uv_transform import UvTransform, takes_textures
from .uvs.multi_user import multi_user_sources
from .world_mesh import world_mesh

if TYPE_CHECKING:
    from ...engine.worker.shared_meshes import SharedMeshes


class ObjectEntry(NamedTuple):
    """Key of an object that gets a lightmap.

    uid:    session uid of the object
    place:  its place in an atlas
    """

    uid: int
    place: UvTransform


class InstanceEntry(NamedTuple):
    """Key of an instance that gets a lightmap.

    uid:            session uid of the instancer
    name:           name of the source object
    persistent_id:  identifies the instance among all instances of the instancer
    place:          its place in an atlas
    """

    uid: int
    name: str
    persistent_id: tuple[int, ...]
    place: UvTransform


#: Key of a mesh that gets a lightmap.
Entry = ObjectEntry | InstanceEntry


@dataclass(frozen=True)
class Placed:
    """The object or instance of a mesh.

    source:     session uid of the source object
    instancer:  session uid of the object that makes the instance; None for an object
    matrix:     (4, 4) float64, object space to world space
    """

    source: int
    instancer: int | None
    matrix: np.ndarray


@dataclass(frozen=True)
class ReadScene:
    """A scene converted for the engine.

    scene:         the engine's scene
    entries:       key of each mesh of the scene; None for an occluder
    notes:         sentences for the user
    fingerprints:  digests of each object with entries, by session uid; see `find_fingerprints`
    uv_digests:    digest of the lightmap UVs of the same objects, by session uid; see `uv_digest.digest_of`
    placed:        object or instance of each mesh of the scene
    """

    scene: Scene
    entries: tuple[Entry | None, ...]
    notes: tuple[str, ...]
    fingerprints: dict[int, str] = field(default_factory=dict)
    uv_digests: dict[int, str] = field(default_factory=dict)
    placed: tuple[Placed, ...] = ()

    @property
    def objects(self) -> tuple[ObjectEntry, ...]:
        """The keys of objects."""
        return tuple(entry for entry in self.entries if isinstance(entry, ObjectEntry))

    @property
    def instances(self) -> tuple[InstanceEntry, ...]:
        """The keys of instances."""
        return tuple(entry for entry in self.entries if isinstance(entry, InstanceEntry))

    @property
    def bytes(self) -> int:
        """Memory of the scene's triangles and textures, bytes."""
        scene = self.scene
        arrays = [getattr(mesh, name) for mesh in scene.meshes for name in _MESH_ARRAYS]
        arrays += [uvs for mesh in scene.meshes for uvs in mesh.texture_uvs.values()]
        maps = [texture for material in scene.materials for texture in textures_of(material)]
        arrays += [scene.world, *(texture.pixels for texture in maps)]
        return sum(array.nbytes for array in {id(array): array for array in arrays}.values())

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return sum(len(mesh.positions) for mesh in self.scene.meshes)


#: Least ratio of a slice's length to the time to iterate over earlier objects (chosen): slices of 0.1 s at
#: 50,000 instances.
_READING = 4

_MESH_ARRAYS = ("positions", "normals", "uvs", "face", "subface", "material")


def read_scene(
    context: SceneContext,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    earlier_notes: Sequence[str] = (),
    paces: dict[str, float] | None = None,
    hurried: bool = False,
    edits_stored: bool = False,
    shared: bool = False,
) -> Generator[Progress | None, None, ReadScene]:
    """Convert the visible objects to an engine.Scene, in slices.

    Raises SceneError, or SceneChangedError if the scene changes between two slices.

    objects:        objects that get a lightmap; each one with faces must have the UV layer. Other surfaces
                    are occluders, unless their role is Ignored.
    uv_layer:       name of the lightmap UV layer
    resolution:     width of the lightmaps, texels
    earlier_notes:  sentences for the user, placed before the sentences of the reading
    paces:          seconds per unit of each stage in earlier readings, by its name; updated by this one
    hurried:        True to accept changes during the reading, for a scene that changes all the time
    edits_stored:   True if `store_edits` was called
    shared:         True to store the meshes of a large scene in memory that the worker maps
    """
    if not edits_stored:
        store_edits(context, objects)
    with SceneWatch(context, hurried) as watch:
        stages = ReadStages({} if paces is None else paces, watch.items)
        baked = {obj.session_uid for obj in objects}
        reading = _SceneReading(watch, baked, uv_layer, resolution, list(earlier_notes))
        yield from stages.follow(stages.objects, reading.objects())
        stages.expect(reading.evaluations, reading.triangles)
        yield from stages.follow(stages.materials, reading.looks())
    read = yield from stages.follow(stages.joining, reading.joined(shared))
    stages.update_paces()
    return read


def store_edits(context: SceneContext, objects: Sequence[bpy.types.Object]) -> None:
    """Write edit-mode changes to the meshes; only this triggers handlers of depsgraph updates."""
    for obj in objects:
        obj.update_from_editmode()
    context.evaluated_depsgraph_get()


class _SceneReading:
    """Reads objects, then materials, world and lights, and joins them to a scene."""

    def __init__(
        self, watch: SceneWatch, baked: set[int], uv_layer: str, resolution: int, notes: list[str]
    ) -> None:
        self._watch, self._uv_layer, self._resolution, self._notes = watch, uv_layer, resolution, notes
        self._cache, self._issues = PixelCache(notes), Issues()
        self._several = multi_user_sources(uv_layer)
        glass = bool(watch.context.scene.hemibake.glass_transmits)
        self._table = MaterialTable(watch, uv_layer, self._several, notes, self._cache, glass)
        self._reader = ItemReader(self._table, baked, uv_layer, notes, self._issues)
        self._lamps = SceneLights(notes)
        self._skipped, self._shows_hair = SkippedItems(), watch.context.view_layer.use_strand
        self._announced: set[int] = set()
        self._next = 0

    def objects(self) -> Slices[None]:
        """Read the meshes of all objects and instances that a render shows.

        The viewport's dependency graph is read in slices, and the one of renders in one piece.
        """
        if uses_render(self._watch.context):
            yield "Reading render meshes"
            self._watch.evaluate(self._read_all)
            yield from self._reader.finish_meshes()
        else:
            yield from self._read_viewport()
        self._readings, self._origin = yield from self._reader.finish()
        self._atlases, self._places = yield from choose_places(
            self._readings, self._several, self._resolution, self._issues
        )
        self._notes += self._issues.messages()
        if not any(self._places):
            seen = {reading.name for reading in self._readings} - self._issues.names
            raise SceneError(_nothing_left(seen, self._notes))

    def _read_viewport(self) -> Slices[None]:
        """Read objects and instances in slices; each continues where the last one ended."""
        while self._next < self._watch.items:
            try:
                announcement = self._read_some()
            except PixelsNeededError as unread:
                yield from unread.reading
                continue
            yield from self._reader.finish_meshes()
            yield self._next / self._watch.items if announcement is None else announcement

    def looks(self) -> Slices[None]:
        """Evaluate materials by Cycles where needed, then read the world and the lights' nodes."""
        moves = _moves(self._readings, self._places)
        self._materials = yield from self._table.finish(self._resolution, moves)
        world = yield from read_world(self._watch, self._notes, self._cache)
        lamps = yield from self._lamps.finish(self._origin, self._watch)
        self._watch.depsgraph()
        datablock = self._watch.context.world
        self._world_group = "" if datablock is None else datablock.lightgroup
        suns = (replace(sun, position=-self._origin, light_group=self._world_group) for sun in world.suns)
        self._world, self._lights = world.radiance, (*lamps, *suns)
        self._light_groups = tuple(group.name for group in self._watch.context.view_layer.lightgroups)
        self._metres_per_unit = metres_per_unit(self._watch.context.scene)
        self._probes = read_probe_volumes(self._watch.context, self._origin, self._notes)
        self._spheres = read_reflection_spheres(self._watch.context, self._origin, self._notes)
        note_ignored_settings(self._watch.context, self._readings, self._materials, self._notes)
        self._left_out = self._skipped.sentences(self._watch.context)

    def joined(self, shared: bool) -> Slices[ReadScene]:
        """Join all data to a scene; Blender's data is no longer accessed. shared: see `read_scene`."""
        fingerprints, uv_digests = (yield from self._fingerprints()), self._uv_digests()
        meshes = yield from self._meshes(self._room() if shared else None)
        scene = Scene(
            meshes=tuple(meshes),
            materials=self._materials,
            atlases=tuple(self._atlases),
            world=self._world,
            origin=self._origin,
            lights=self._lights,
            light_groups=self._light_groups,
            world_light_group=self._world_group,
            metres_per_unit=self._metres_per_unit,
            probe_volumes=self._probes,
            reflection_spheres=self._spheres,
        )
        scene = yield from replace_invalid_values(scene, self._notes)
        entries = tuple(
            _entry(reading, place) for reading, place in zip(self._readings, self._places, strict=True)
        )
        placed = tuple(Placed(each.source, each.instancer, each.matrix) for each in self._readings)
        return ReadScene(scene, entries, (*self._notes, *self._left_out), fingerprints, uv_digests, placed)

    def _room(self) -> SharedMeshes | None:
        """Return shared memory for the meshes; None for a small scene, or if shared memory is short."""
        from ...engine.errors import WorkerError
        from ...engine.worker.shared_meshes import SharedMeshes

        if not SharedMeshes.pay_off(self.triangles):
            return None
        maps = [uvs for reading in self._readings for uvs in reading.mesh.corners.texture_uvs.values()]
        try:
            return SharedMeshes(self.triangles, sum(map(len, maps)), len(maps))
        except WorkerError:
            return None

    def _meshes(self, room: SharedMeshes | None) -> Slices[list[Mesh]]:
        """Return the world-space meshes; each mesh in object space is released after its last use.

        room:  memory of the meshes; None for memory of this process
        """
        del self._reader
        meshes, atlases = [], {name: index for index, name in enumerate(self._atlases)}
        for index, place in enumerate(self._places):
            atlas = NO_LIGHTMAP if place is None else atlases[place.atlas]
            mesh = yield from world_mesh(self._readings[index], self._origin, atlas, place)
            meshes.append(mesh if room is None else room.moved(mesh))
            self._readings[index] = replace(self._readings[index], shape=None)
        return meshes

    def _uv_digests(self) -> dict[int, str]:
        """Return the digest of the lightmap UVs of each object that gets a lightmap, by session uid.

        An object that only instances show gets the digest of its instances if it is the same for all.
        """
        placed = zip(self._readings, self._places, strict=True)
        readings = [reading for reading, place in placed if place is not None]
        shown: dict[int, set[str]] = {}
        for reading in readings:
            if reading.instancer not in (None, reading.source):
                shown.setdefault(reading.source, set()).add(reading.mesh.uv_digest)
        alike = {source: digest for source, (digest, *others) in shown.items() if not others}
        own = {reading.source: reading.mesh.uv_digest for reading in readings if reading.instancer is None}
        return alike | own

    def _fingerprints(self) -> Slices[dict[int, str]]:
        """Return the fingerprint of each object that gets a lightmap, with its instances, by session uid."""
        groups = self._light_groups, self._world_group
        # Left out in Rec.709, so that fingerprints of older files stay valid.
        space = () if is_rec709() else (working_space(),)
        light = (*in_the_world(self._lights, self._origin), self._world, *groups, *space)
        found = yield from find_fingerprints(self._readings, self._places, self._materials, light)
        by_source: dict[int, list[str]] = {}
        for reading, fingerprint in zip(self._readings, found, strict=True):
            if fingerprint is not None:
                by_source.setdefault(reading.source, []).append(fingerprint)
        return {source: combined(fingerprints) for source, fingerprints in by_source.items()}

    @property
    def evaluations(self) -> int:
        """Number of materials that Cycles must evaluate."""
        return self._table.evaluations

    @property
    def triangles(self) -> int:
        """Number of triangles, including instances."""
        return sum(len(reading.mesh.slots) for reading in self._readings)

    def _read_some(self) -> str | None:
        """Read objects for the length of a slice; return an announcement if a large one is next.

        Blender iterates over all objects before the first one. A slice takes several times as long, so that
        the time of many instances grows with their number, not with its square.
        """
        override, depsgraph = self._watch.context.material_override, self._watch.depsgraph()
        began, time = perf_counter(), None
        for item in scene_items(depsgraph, self._watch.visible, self._next, with_hair=True):
            time = time or Slice(_READING * (perf_counter() - began))
            self._next = item.index
            uid = item.source.session_uid
            if (
                item.object.type == "MESH"
                and item.shows_self
                and self._reader.is_large(item)
                and uid not in self._announced
            ):
                self._announced.add(uid)
                return f"Reading object '{item.source.name}'"
            self._read_item(item, depsgraph, override)
            if time.over:
                self._next += 1
                return None
        self._next = self._watch.items
        return None

    def _read_all(self, evaluation: Evaluation) -> None:
        """Read all objects and instances in one piece, with the images that materials need."""
        override = self._watch.context.material_override
        for item in evaluation.items(self._watch.visible, with_hair=True):
            depsgraph = evaluation.depsgraph_of(item)
            while True:
                try:
                    self._read_item(item, depsgraph, override)
                    break
                except PixelsNeededError as unread:
                    finished(unread.reading)

    def _read_item(
        self, item: SceneItem, depsgraph: bpy.types.Depsgraph, override: bpy.types.Material | None
    ) -> None:
        """Read an object or instance; raises PixelsNeededError if an image must be read first."""
        if self._shows_hair and has_strands(item.object, depsgraph):
            self._reader.add_hair(item, depsgraph, override)
        if not item.shows_self:
            return
        if item.source.type == "LIGHT":
            self._lamps.add(item)
        elif item.object.type == "MESH":
            self._reader.add(item, override)
        else:
            self._skipped.add(item)


def _entry(reading: ReadObject, place: UvTransform | None) -> Entry | None:
    if place is None:
        return None
    if reading.instancer is None:
        return ObjectEntry(reading.source, place)
    return InstanceEntry(reading.instancer, reading.name, reading.persistent_id, place)


def _moves(readings: Sequence[ReadObject], places: Sequence[UvTransform | None]) -> dict[int, Move]:
    """Return the transform from lightmap UVs to the place in the atlas of each object with textures."""
    return {
        reading.source: place.apply
        for reading, place in zip(readings, places, strict=True)
        if place is not None and takes_textures(reading, place)
    }


def _nothing_left(seen: set[str], notes: Sequence[str]) -> str:
    """Return the reason why there is nothing to bake; `seen`: names of objects with the role No Lightmap."""
    reasons = " ".join(first_line(note) for note in notes)
    details = [line for note in notes for line in note.splitlines()[1:]]
    if seen:
        sentence = (
            f"Nothing is left to bake: {{}} {'has' if len(seen) == 1 else 'have'} the role No Lightmap. "
            f"Set the role of an object to Baked. {reasons}".strip()
        )
        return "\n".join([object_message(sentence, sorted(seen)), *details])
    if notes:
        return "\n".join([f"Nothing is left to bake. {reasons}", *details])
    return "The scene has no mesh with faces to bake. Add a mesh object, or enable one in renders."
