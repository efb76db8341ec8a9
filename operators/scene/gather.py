"""The visible objects of a Blender scene, as the engine wants them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy

from ...engine.errors import SceneError
from ...engine.scene import Material, Mesh, Scene, check_scene
from .atlases import assign_atlases
from .materials import read_material
from .meshes import middle, read_corners, world_mesh
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


class MaterialTable:
    """The materials of all objects, each read once."""

    def __init__(self, notes: list[str]) -> None:
        self._notes = notes
        self._index: dict[int | None, int] = {}
        self.materials: list[Material] = []

    def index(self, material: bpy.types.Material | None) -> int:
        """Return the index of a material in `Scene.materials`."""
        key = None if material is None else material.session_uid
        if key not in self._index:
            self._index[key] = len(self.materials)
            self.materials.append(read_material(material, self._notes))
        return self._index[key]


def gather(
    context: bpy.types.Context,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
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
    table = MaterialTable(notes)
    atlases: list[str] = []
    meshes: list[Mesh] = []
    baked: list[tuple[int, str]] = []
    for obj, atlas in zip(objects, assign_atlases(objects, notes), strict=True):
        mesh = _read_object(obj, depsgraph, uv_layer, origin, table, notes)
        if mesh is not None:
            meshes.append(replace(mesh, atlas=_index(atlases, atlas)))
            baked.append((obj.session_uid, atlas))
    if notes and not meshes:
        reasons = " ".join(notes)
        raise SceneError(f"Nothing is left to bake. {reasons} Give an object faces that have an area.")
    world = read_world(context.scene.world, notes)
    scene = Scene(tuple(meshes), tuple(table.materials), tuple(atlases), world, origin)
    check_scene(scene)
    _note_lights(context, notes)
    return Gathered(scene, tuple(baked), tuple(notes))


def _read_object(obj, depsgraph, uv_layer, origin, table, notes) -> Mesh | None:
    """Return one object as an engine.Mesh, None with a note if it has no face with an area."""
    evaluated = obj.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        if len(mesh.polygons) == 0:
            notes.append(f"Object '{obj.name}' has no faces and is left out.")
            return None
        slots = [table.index(material) for material in _slot_materials(obj, mesh)]
        result = world_mesh(evaluated, read_corners(obj, mesh, uv_layer), origin, slots, notes)
    finally:
        evaluated.to_mesh_clear()
    return result if len(result.positions) else None


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


def _note_lights(context: bpy.types.Context, notes: list[str]) -> None:
    """Say that light objects are not baked, if a render would show any."""
    lights = [obj for obj in context.view_layer.objects if obj.type == "LIGHT" and not obj.hide_render]
    if lights:
        notes.append(
            f"{len(lights)} light objects are not baked: only emissive materials and the world give light."
        )
