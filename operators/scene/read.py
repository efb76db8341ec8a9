"""The visible objects of a Blender scene, as the engine wants them."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.naming import first_line, naming
from ...engine.progress import Progress, finished
from ...engine.scene.checks import check_scene
from ...engine.scene.model import OCCLUDER, Mesh, Scene
from ..lookup import find_all
from .faults import without_faults
from .light.lights import Lamps
from .light.world import read_world
from .materials.material_table import MaterialTable
from .materials.shader_bake import Move
from .messages import Troubles
from .objects.items import scene_items
from .objects.skipped import note_skipped
from .place import Place, takes_textures
from .places import choose_places
from .scene_context import SceneContext
from .scene_objects import ItemReader, Reading
from .uvs.multi_user import multi_user_sources
from .world_mesh import world_mesh

#: Session uid of a baked object, and where its charts are; of an instance session uid of the instancer,
#: name of the object shown, persistent id, and where its charts are.
Entry = tuple[int, Place] | tuple[int, str, tuple[int, ...], Place]


@dataclass(frozen=True)
class ReadScene:
    """A scene ready for the engine.

    entries  of each mesh of the scene, None for an occluder
    notes    sentences for the user
    """

    scene: Scene
    entries: tuple[Entry | None, ...]
    notes: tuple[str, ...]

    @property
    def objects(self) -> tuple[tuple[int, Place], ...]:
        """The entries of objects."""
        return tuple(entry for entry in self.entries if entry is not None and len(entry) == 2)

    @property
    def instances(self) -> tuple[tuple[int, str, tuple[int, ...], Place], ...]:
        """The entries of instances."""
        return tuple(entry for entry in self.entries if entry is not None and len(entry) == 4)

    @property
    def bytes(self) -> int:
        """Memory of the scene's triangles and textures."""
        scene = self.scene
        arrays = [getattr(mesh, name) for mesh in scene.meshes for name in _MESH_ARRAYS]
        arrays += [uvs for mesh in scene.meshes for uvs in mesh.texture_uvs.values()]
        maps = [
            texture
            for material in scene.materials
            for texture in (material.reflectance_map, material.emission_map, material.alpha_map)
            if texture is not None
        ]
        arrays += [scene.world, *(texture.pixels for texture in maps)]
        return sum(array.nbytes for array in {id(array): array for array in arrays}.values())

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return sum(len(mesh.positions) for mesh in self.scene.meshes)


_MESH_ARRAYS = ("positions", "normals", "uvs", "face", "subface", "material")


def read_scene(
    context: SceneContext,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    earlier_notes: Sequence[str] = (),
) -> Generator[Progress | None, None, ReadScene]:
    """Read what the scene shows in slices, return it as an engine.Scene; raises SceneError.

    objects  those that get a lightmap; every one with faces must have the UV layer. All other surfaces
             are occluders, unless they are to be ignored.
    """
    notes = list(earlier_notes)
    uids = [obj.session_uid for obj in objects]
    yield Progress("Reading objects", 0.0)
    yield None
    objects = find_all(bpy.data.objects, uids)
    for obj in objects:
        obj.update_from_editmode()
    depsgraph = context.evaluated_depsgraph_get()
    several, troubles = multi_user_sources(uv_layer), Troubles()
    table = MaterialTable(depsgraph, uv_layer, several, notes)
    try:
        baked = {obj.session_uid for obj in objects}
        reader = ItemReader(depsgraph, table, baked, uv_layer, notes, troubles)
        lamps = Lamps(notes)
        for item in scene_items(context, depsgraph):
            if item.source.type == "LIGHT":
                lamps.add(item)
            elif item.object.type == "MESH":
                reader.add(item)
        readings, origin = reader.finish()
        atlases, places = finished(choose_places(readings, several, resolution, troubles))
        notes += troubles.tell()
        if not any(places):
            raise SceneError(_nothing_left({reading.name for reading in readings} - troubles.names, notes))
        meshes = [
            _mesh(reading, place, atlases, origin) for reading, place in zip(readings, places, strict=True)
        ]
        scene = Scene(
            meshes=tuple(meshes),
            materials=table.finish(resolution, _moves(readings, places)),
            atlases=tuple(atlases),
            world=read_world(context.scene.world, notes),
            origin=origin,
            lights=lamps.finish(origin),
        )
    finally:
        table.discard()
    scene = without_faults(scene, notes)
    check_scene(scene)
    note_skipped(context, notes)
    entries = tuple(_entry(reading, place) for reading, place in zip(readings, places, strict=True))
    return ReadScene(scene, entries, tuple(notes))


def _entry(reading: Reading, place: Place | None) -> Entry | None:
    if place is None:
        return None
    if reading.instancer is None:
        return reading.source, place
    return reading.instancer, reading.name, reading.persistent_id, place


def _moves(readings: Sequence[Reading], places: Sequence[Place | None]) -> dict[int, Move]:
    """Return how the charts of objects, by session uid, get to where textures over them are made."""
    return {
        reading.source: place.apply
        for reading, place in zip(readings, places, strict=True)
        if place is not None and takes_textures(reading, place)
    }


def _mesh(reading: Reading, place: Place | None, atlases: list[str], origin: np.ndarray) -> Mesh:
    """Return a reading in the world, with its charts in their place."""
    atlas = OCCLUDER if place is None else atlases.index(place.atlas)
    return world_mesh(reading, origin, atlas, place)


def _nothing_left(seen: set[str], notes: Sequence[str]) -> str:
    """Return why there is nothing to bake; `seen` are objects that are occluders by choice."""
    reasons = " ".join(first_line(note) for note in notes)
    details = [line for note in notes for line in note.splitlines()[1:]]
    if seen:
        sentence = (
            f"Nothing is left to bake: {{}} {'is' if len(seen) == 1 else 'are'} only seen. "
            f"Set the role of an object to Baked. {reasons}".strip()
        )
        return "\n".join([naming(sentence, sorted(seen)), *details])
    if notes:
        return "\n".join([f"Nothing is left to bake. {reasons}", *details])
    return (
        "The scene has no mesh with faces to bake. Add a mesh object, or make one visible "
        "in the viewport and in renders."
    )
