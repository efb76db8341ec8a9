"""Evaluates materials by Cycles: bakes copies of objects into textures over lightmap UVs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ...compat import new_node_tree, remove_scene
from ..objects.meshes import LIGHTMAP_UVS, read_array, read_uvs
from ..scene_context import SceneContext
from ..temporary_scene import share_values
from ..uvs.uv_layers import MOST_LAYERS
from .evaluated_passes import Pass
from .substitution import Substitution

#: Smallest and largest width of an evaluated texture, texels.
_SMALLEST, _LARGEST = 512, 4096

#: Factor by which the textures may be smaller than _SMALLEST if a material has many variants.
_SHRINKING = 4

#: Samples per texel of an evaluation, and margin around charts in texels.
_SAMPLES = 4
_MARGIN = 8

#: Maps UVs of a mesh to lightmap UVs, (..., 2) -> (..., 2) float32.
Move = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class EvaluatedMesh:
    """A copy of a mesh on which materials are evaluated.

    source:    session uid of the object
    uv_layer:  name of its lightmap UV layer
    mesh:      the copy, which is removed afterwards
    slots:     material of each slot; None for slots that are not evaluated
    matrix:    object space to world space
    rest:      (v, 3) float32, vertex positions before deformation, which Generated coordinates use; None if
               nothing deforms the mesh
    """

    source: int
    uv_layer: str
    mesh: bpy.types.Mesh
    slots: tuple[bpy.types.Material | None, ...]
    matrix: Matrix
    rest: np.ndarray | None = None


def copy_shape(
    evaluated: bpy.types.Object,
    uv_layer: str,
    matrix: np.ndarray,
    depsgraph: bpy.types.Depsgraph,
    slots: Sequence[bpy.types.Material | None],
    rest: np.ndarray | None = None,
) -> EvaluatedMesh:
    """Copy the mesh of an evaluated object with all its layers.

    uv_layer:  name of the layer with its lightmap UVs
    matrix:    (4, 4) float64, object or instance space to world space
    rest:      (v, 3) float32, see `rest_positions`; ignored if the number of vertices differs
    """
    mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    # Generated coordinates use the box of the original mesh, not that of the copy.
    mesh.use_auto_texspace = False
    if rest is not None and len(rest) != len(mesh.vertices):  # in edit mode
        rest = None
    uid = evaluated.original.session_uid
    return EvaluatedMesh(uid, uv_layer, mesh, tuple(slots), Matrix(matrix.tolist()), rest)


def rest_positions(mesh: bpy.types.Mesh) -> np.ndarray | None:
    """Return vertex positions before deformation, (v, 3) float32; None if they are the same.

    mesh:  mesh of an object evaluated for a render; meshes of the viewport and copies lack these positions
    """
    rest = read_array(mesh.vertices, "undeformed_co", 3, np.float32)
    return None if np.array_equal(rest, read_array(mesh.vertices, "co", 3, np.float32)) else rest


def add_lightmap_uv_map(mesh: bpy.types.Mesh, uv_layer: str, move: Move | None) -> bool:
    """Add the UV map LIGHTMAP_UVS to a copied mesh, from a layer; return whether the mesh has that layer.

    move:  maps UVs of the layer to UVs of the map; None keeps them
    """
    layer = mesh.uv_layers.get(uv_layer)
    if layer is None:
        return False
    uvs = read_uvs(layer)
    rendered = layer.active_render
    if len(mesh.uv_layers) == MOST_LAYERS:
        mesh.uv_layers.remove(layer)
    laid = mesh.uv_layers.new(name=LIGHTMAP_UVS, do_init=False)
    laid.uv.foreach_set("vector", (uvs if move is None else move(uvs)).reshape(-1))
    if rendered and uv_layer not in mesh.uv_layers:
        laid.active_render = True
    return True


def remove_shapes(shapes: Sequence[EvaluatedMesh]) -> None:
    """Remove the copied meshes."""
    for shape in shapes:
        bpy.data.meshes.remove(shape.mesh)


def texture_size(resolution: int, variants: int) -> int:
    """Return the width of textures over lightmap UVs, texels.

    variants:  number of variants of the material for objects of one lightmap, each on a part of it
    """
    scale = np.sqrt(variants)
    return int(np.clip(resolution / scale, _SMALLEST / min(scale, _SHRINKING), _LARGEST))


def bake_pass(
    evaluation: Pass,
    material: bpy.types.Material,
    shapes: Sequence[EvaluatedMesh],
    size: int,
    context: SceneContext,
    glass: bool = True,
) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate a quantity of a material over LIGHTMAP_UVS; return its values and the covered texels.

    These are (size, size, 3) float32 and (size, size) bool. Raises RuntimeError if Cycles cannot bake.

    context:  context of the scene with the meshes
    glass:    True if refracting closures transmit light without refraction
    """
    substitution = Substitution(evaluation.quantity, evaluation.rays, glass)
    with _stage(shapes, material, substitution, context) as stage:
        return stage.bake(size)


class _Stage:
    """Temporary scene in which copies of the meshes use a copy of one material."""

    def __init__(
        self, scene: bpy.types.Scene, objects: list[bpy.types.Object], worn: bpy.types.Material
    ) -> None:
        self._scene, self._objects, self._worn = scene, objects, worn

    def bake(self, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Bake the material's emission; return it, (size, size, 3) float32, and the covered texels, bool."""
        tree = self._worn.node_tree
        image = bpy.data.images.new("hemibake", size, size, alpha=True, float_buffer=True, is_data=True)
        node = tree.nodes.new("ShaderNodeTexImage")
        try:
            image.generated_color = (0.0, 0.0, 0.0, 0.0)
            node.image = image
            tree.nodes.active = node
            bake_emission(self._scene, self._objects, _MARGIN)
            pixels = np.empty(size * size * 4, np.float32)
            image.pixels.foreach_get(pixels)
            pixels = pixels.reshape(size, size, 4)
            return pixels[..., :3].copy(), pixels[..., 3] > 0
        finally:
            tree.nodes.remove(node)
            bpy.data.images.remove(image)


@contextmanager
def _stage(
    shapes: Sequence[EvaluatedMesh],
    material: bpy.types.Material,
    substitution: Substitution,
    context: SceneContext,
) -> Iterator[_Stage]:
    """Set up a scene with a material that emits a quantity, and remove the scene at the end."""
    scene = bpy.data.scenes.new("hemibake")
    worn = material.copy()
    blank = bpy.data.materials.new("hemibake")
    nothing = bpy.data.images.new("hemibake", 1, 1)
    objects: list[bpy.types.Object] = []
    try:
        substitution.apply(worn.node_tree)
        blank_node = new_node_tree(blank).nodes.new("ShaderNodeTexImage")
        blank_node.image = nothing
        blank.node_tree.nodes.active = blank_node
        for shape in shapes:
            objects.append(place_shape(scene, shape))
            assign_materials(shape, [worn if slot == material else blank for slot in shape.slots])
        share_values(context, scene)
        use_cycles(scene)
        yield _Stage(scene, objects, worn)
    finally:
        for obj in objects:
            bpy.data.objects.remove(obj)
        remove_scene(scene)
        for unused in (worn, blank):
            bpy.data.materials.remove(unused)
        substitution.remove()
        bpy.data.images.remove(nothing)


def place_shape(scene: bpy.types.Scene, shape: EvaluatedMesh) -> bpy.types.Object:
    """Add an object with a copied mesh to a temporary scene; the caller removes it."""
    obj = bpy.data.objects.new("hemibake", shape.mesh)
    scene.collection.objects.link(obj)
    obj.matrix_world = shape.matrix
    if shape.rest is not None and shape.mesh.shape_keys is None:
        _deform(obj, shape.rest)
    return obj


def _deform(obj: bpy.types.Object, rest: np.ndarray) -> None:
    """Move a mesh to positions before deformation, and deform it by a shape key to its present ones."""
    mesh = obj.data
    deformed = read_array(mesh.vertices, "co", 3, np.float32)
    basis, key = (obj.shape_key_add(name=name) for name in ("Basis", "Deformed"))
    key.data.foreach_set("co", deformed.ravel())
    key.value = 1.0
    for vertices in (basis.data, mesh.vertices):
        vertices.foreach_set("co", rest.ravel())
    mesh.update()


def assign_materials(shape: EvaluatedMesh, materials: Sequence[bpy.types.Material]) -> None:
    """Assign a material to each slot of a copied mesh, and activate its map LIGHTMAP_UVS if it has one."""
    while len(shape.mesh.materials) < len(shape.slots):
        shape.mesh.materials.append(None)
    for index, material in enumerate(materials):
        shape.mesh.materials[index] = material
    layer = shape.mesh.uv_layers.get(LIGHTMAP_UVS)
    if layer is not None:
        shape.mesh.uv_layers.active = layer


def use_cycles(scene: bpy.types.Scene) -> None:
    """Set up Cycles with few samples, since emission does not depend on light."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", _SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.view_layers[0].update()


def bake_emission(scene: bpy.types.Scene, objects: Sequence[bpy.types.Object], margin: int) -> None:
    """Bake the emission of objects into the active images of their materials; raises RuntimeError.

    margin:  texels around charts
    """
    with bpy.context.temp_override(
        scene=scene,
        view_layer=scene.view_layers[0],
        active_object=objects[0],
        object=objects[0],
        selected_objects=objects,
        selected_editable_objects=objects,
    ):
        bpy.ops.object.bake(
            type="EMIT", margin=margin, margin_type="EXTEND", use_clear=False,
            target="IMAGE_TEXTURES", save_mode="INTERNAL", use_selected_to_active=False,
        )  # fmt: skip
