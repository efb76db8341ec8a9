"""The visible objects of a Blender scene, as the engine wants them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.scene import Material, Mesh, Scene, check_scene
from .atlases import assign_atlases
from .copies import copies_message, copying_modifiers
from .material_table import MaterialTable
from .meshes import middle, read_corners, world_mesh
from .skipped import note_skipped
from .world import read_world


@dataclass(frozen=True)
class Gathered:
    """A scene ready for the engine.

    objects  session uid and atlas name of each baked object, in the order of `scene.meshes`
    notes    sentences for the user
    """

    scene: Scene
    objects: tuple[tuple[int, str], ...]
    notes: tuple[str, ...]


class ObjectReader:
    """Reads objects as engine meshes and collects what there is to say about them.

    copying   names of the modifiers that make lightmap UVs overlap, by object
    faceless  an object was left out because it has no face with an area
    """

    def __init__(
        self, depsgraph: bpy.types.Depsgraph, uv_layer: str, origin: np.ndarray, notes: list[str]
    ) -> None:
        self._depsgraph, self._uv_layer, self._origin = depsgraph, uv_layer, origin
        self._notes = notes
        self._table = MaterialTable(uv_layer, notes)
        self.copying: dict[str, list[str]] = {}
        self.faceless = False

    def materials(self, resolution: int) -> tuple[Material, ...]:
        """Return the materials of the objects read; see `MaterialTable.finish`."""
        return self._table.finish(resolution)

    def read(self, obj: bpy.types.Object) -> Mesh | None:
        """Return one object as an engine.Mesh; None, said in the notes, if it has to be left out."""
        evaluated = obj.evaluated_get(self._depsgraph)
        mesh = evaluated.to_mesh()
        try:
            return self._read_mesh(obj, evaluated, mesh) if self._has_faces(obj, mesh) else None
        finally:
            evaluated.to_mesh_clear()

    def _has_faces(self, obj: bpy.types.Object, mesh: bpy.types.Mesh) -> bool:
        """Return whether an object has faces with a place in a lightmap."""
        if not len(mesh.polygons):
            self._notes.append(f"Object '{obj.name}' has no faces and is left out.")
            self.faceless = True
        elif not len(obj.data.polygons) and self._uv_layer not in mesh.uv_layers:
            self._notes.append(
                f"The faces of object '{obj.name}' are made by its modifiers and have no lightmap UVs: "
                "it is left out. Apply the modifiers to bake it."
            )
        else:
            return True
        return False

    def _read_mesh(self, obj, evaluated: bpy.types.Object, mesh: bpy.types.Mesh) -> Mesh | None:
        copying = copying_modifiers(obj, mesh, self._uv_layer)
        if copying:
            self.copying[obj.name] = copying
        slots = [self._table.index(material, None) for material in _slot_materials(obj, mesh)]
        corners = read_corners(obj, mesh, self._uv_layer)
        result = world_mesh(evaluated, corners, self._origin, slots, self._notes)
        if len(result.positions):
            return result
        self.faceless = True
        return None


def gather(
    context: bpy.types.Context,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    earlier_notes: Sequence[str] = (),
) -> Gathered:
    """Return mesh objects as an engine.Scene; raises SceneError.

    Every object with faces must have the UV layer; one without faces is left out with a note.
    """
    notes = list(earlier_notes)
    for obj in objects:
        obj.update_from_editmode()
    depsgraph = context.evaluated_depsgraph_get()
    origin = middle([obj.evaluated_get(depsgraph) for obj in objects])
    reader = ObjectReader(depsgraph, uv_layer, origin, notes)
    atlases: list[str] = []
    meshes: list[Mesh] = []
    baked: list[tuple[int, str]] = []
    for obj, atlas in zip(objects, assign_atlases(objects, notes), strict=True):
        mesh = reader.read(obj)
        if mesh is not None:
            meshes.append(replace(mesh, atlas=_index(atlases, atlas)))
            baked.append((obj.session_uid, atlas))
    _check_read(reader, meshes, uv_layer, notes)
    world = read_world(context.scene.world, notes)
    scene = Scene(tuple(meshes), reader.materials(resolution), tuple(atlases), world, origin)
    check_scene(scene)
    note_skipped(context, depsgraph, notes)
    return Gathered(scene, tuple(baked), tuple(notes))


def _check_read(reader: ObjectReader, meshes: Sequence[Mesh], uv_layer: str, notes: Sequence[str]) -> None:
    """Raise SceneError if nothing is left, or if modifiers make UVs overlap."""
    if notes and not meshes:
        remedy = " Give an object faces that have an area." if reader.faceless else ""
        raise SceneError(f"Nothing is left to bake. {' '.join(notes)}{remedy}")
    if reader.copying:
        raise SceneError(copies_message(reader.copying, uv_layer))


def _slot_materials(obj: bpy.types.Object, mesh: bpy.types.Mesh) -> list[bpy.types.Material | None]:
    """Return the material of each slot: the object's own where the slot is linked to the object.

    While the object shows its lightmap, the slots as they were before the preview count.
    """
    materials = [material and material.original for material in mesh.materials]
    slots = obj.hemibake.slots or obj.material_slots
    for index, slot in enumerate(slots):
        if slot.link == "OBJECT" and index < len(materials):
            materials[index] = slot.material
    return materials or [None]


def _index(names: list[str], name: str) -> int:
    """Return the index of a name in a list, appended if it is new."""
    if name not in names:
        names.append(name)
    return names.index(name)
