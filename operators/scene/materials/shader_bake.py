"""Materials that only Blender can evaluate: baked by Cycles, on copies, into textures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ...compat import new_node_tree, node_input
from ..objects.meshes import LIGHTMAP_UVS, read_uvs
from ..slices import Slices, row_slices
from ..uvs.uv_layers import MOST_LAYERS
from .sockets import feeder

#: Smallest and largest width of such a texture, texels.
_SMALLEST, _LARGEST = 512, 4096

#: Textures of many variants of a material may be smaller by this.
_SHRINKING = 4

#: Samples of each texel; texels beyond chart borders.
_SAMPLES = 4
_MARGIN = 8

#: What is baked: Cycles' bake type and its passes.
_PASSES = {"reflectance": ("DIFFUSE", {"COLOR"}), "emission": ("EMIT", set()), "alpha": ("EMIT", set())}


#: Inputs of the Principled BSDF that make it shine.
_SHINY = ("Specular IOR Level", "Coat Weight", "Sheen Weight")


#: From UVs of a mesh to lightmap UVs, (..., 2) float32.
Move = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Shape:
    """A mesh that shows materials to be evaluated; the mesh is a copy that is removed afterwards.

    source    session uid of the object
    uv_layer  its lightmap UV layer
    slots     material of each slot, None where nothing has to be evaluated
    matrix    object space to world space
    """

    source: int
    uv_layer: str
    mesh: bpy.types.Mesh
    slots: tuple[bpy.types.Material | None, ...]
    matrix: Matrix


def copy_shape(
    evaluated: bpy.types.Object,
    uv_layer: str,
    matrix: np.ndarray,
    depsgraph: bpy.types.Depsgraph,
    slots: Sequence[bpy.types.Material | None],
) -> Shape:
    """Copy an evaluated object with all its layers.

    uv_layer  the one with its lightmap UVs
    matrix    (4, 4) float64, where it or its instance is
    """
    mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
    return Shape(evaluated.original.session_uid, uv_layer, mesh, tuple(slots), Matrix(matrix.tolist()))


def lay_lightmap_uvs(mesh: bpy.types.Mesh, uv_layer: str, move: Move | None) -> bool:
    """Give a copy of a mesh the UV map LIGHTMAP_UVS, from a layer; return whether it has that layer.

    move  from UVs of the layer to those of the map; None keeps them
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


def remove_shapes(shapes: Sequence[Shape]) -> None:
    """Remove the copies."""
    for shape in shapes:
        bpy.data.meshes.remove(shape.mesh)


def passes_of(material: bpy.types.Material) -> list[str]:
    """Return the passes that make up a material: "alpha" is missing where it is 1."""
    return [name for name in _PASSES if name != "alpha" or _alpha_source(material.node_tree) is not None]


def texture_size(resolution: int, variants: int) -> int:
    """Return the width of textures over lightmap UVs, texels.

    variants: how many there are of a material for objects of one lightmap, each on a part of it.
    """
    scale = np.sqrt(variants)
    return int(np.clip(resolution / scale, _SMALLEST / min(scale, _SHRINKING), _LARGEST))


def bake_pass(name: str, material: bpy.types.Material, shapes: Sequence[Shape], size: int) -> np.ndarray:
    """Return a pass of a material over the UV map LIGHTMAP_UVS of shapes, (size, size, 3) float32.

    It is as Cycles gives it. Raises RuntimeError if Cycles cannot bake.
    """
    with _stage(shapes, material) as stage:
        return stage.bake(name, size)


def finish_passes(passes: dict[str, np.ndarray]) -> Slices[None]:
    """Make of what Cycles gave, in place, what a material has.

    They are "reflectance" and "emission", (h, w, 3), and "alpha", (h, w, 1) if it is there.
    """
    size = len(passes["reflectance"])
    if "alpha" in passes:
        passes["alpha"] = passes["alpha"][..., :1].copy()
    for rows in row_slices(size, 7 * size):
        for pixels in passes.values():
            np.maximum(np.nan_to_num(pixels[rows]), 0, out=pixels[rows])
        reflectance = passes["reflectance"][rows]
        if "alpha" in passes:
            alpha = np.minimum(passes["alpha"][rows], 1, out=passes["alpha"][rows])
            reflectance[:] = np.where(alpha > 1e-3, reflectance / np.maximum(alpha, 1e-3), 0)
        np.minimum(reflectance, 1, out=reflectance)
        yield rows.stop / size


class _Stage:
    """A scene of its own with copies of the shapes that wear a copy of one material."""

    def __init__(
        self, scene: bpy.types.Scene, objects: list[bpy.types.Object], worn: bpy.types.Material
    ) -> None:
        self._scene, self._objects, self._worn = scene, objects, worn

    def bake(self, name: str, size: int) -> np.ndarray:
        """Return one pass, (size, size, 3) float32."""
        tree = self._worn.node_tree
        if name == "alpha":
            _show_alpha(tree)
        image = bpy.data.images.new("hemibake", size, size, alpha=True, float_buffer=True, is_data=True)
        node = tree.nodes.new("ShaderNodeTexImage")
        try:
            node.image = image
            tree.nodes.active = node
            kind, passes = _PASSES[name]
            with bpy.context.temp_override(
                scene=self._scene,
                view_layer=self._scene.view_layers[0],
                active_object=self._objects[0],
                object=self._objects[0],
                selected_objects=self._objects,
                selected_editable_objects=self._objects,
            ):
                bpy.ops.object.bake(
                    type=kind, pass_filter=passes, margin=_MARGIN, margin_type="EXTEND", use_clear=False,
                    target="IMAGE_TEXTURES", save_mode="INTERNAL", use_selected_to_active=False,
                )  # fmt: skip
            pixels = np.empty(size * size * 4, np.float32)
            image.pixels.foreach_get(pixels)
            return pixels.reshape(size, size, 4)[..., :3].copy()
        finally:
            tree.nodes.remove(node)
            bpy.data.images.remove(image)


@contextmanager
def _stage(shapes: Sequence[Shape], material: bpy.types.Material) -> Iterator[_Stage]:
    """Set the stage for a material, and remove all of it in the end."""
    scene = bpy.data.scenes.new("hemibake")
    worn, groups = material.copy(), dict[bpy.types.NodeTree, bpy.types.NodeTree]()
    blank = bpy.data.materials.new("hemibake")
    nothing = bpy.data.images.new("hemibake", 1, 1)
    objects: list[bpy.types.Object] = []
    try:
        _dull(worn.node_tree, groups)
        blank_node = new_node_tree(blank).nodes.new("ShaderNodeTexImage")
        blank_node.image = nothing
        blank.node_tree.nodes.active = blank_node
        for shape in shapes:
            obj = bpy.data.objects.new("hemibake", shape.mesh)
            objects.append(obj)
            scene.collection.objects.link(obj)
            _dress(obj, shape, material, worn, blank)
        _set_up(scene)
        yield _Stage(scene, objects, worn)
    finally:
        for obj in objects:
            bpy.data.objects.remove(obj)
        bpy.data.scenes.remove(scene)
        for unused in (worn, blank):
            bpy.data.materials.remove(unused)
        for group in groups.values():
            bpy.data.node_groups.remove(group)
        bpy.data.images.remove(nothing)


def _dull(tree: bpy.types.NodeTree, groups: dict[bpy.types.NodeTree, bpy.types.NodeTree]) -> None:
    """Switch off the shine of a tree, and of copies of the groups in it: diffuse colour is without it.

    groups  the copy of each group
    """
    for node in tree.nodes:
        group = getattr(node, "node_tree", None)
        if group is not None:
            if group not in groups:
                groups[group] = group.copy()
                _dull(groups[group], groups)
            node.node_tree = groups[group]
        for socket in (node_input(node, name) for name in _SHINY):
            if socket is not None and node.bl_idname == "ShaderNodeBsdfPrincipled":
                for link in list(socket.links):
                    tree.links.remove(link)
                socket.default_value = 0.0


def _dress(
    obj: bpy.types.Object,
    shape: Shape,
    material: bpy.types.Material,
    worn: bpy.types.Material,
    blank: bpy.types.Material,
) -> None:
    """Let a copy wear the copy of the material where the shape wears it, else something blank."""
    obj.matrix_world = shape.matrix
    while len(shape.mesh.materials) < len(shape.slots):
        shape.mesh.materials.append(None)
    for index, slot in enumerate(shape.slots):
        shape.mesh.materials[index] = worn if slot == material else blank
    layer = shape.mesh.uv_layers.get(LIGHTMAP_UVS)
    if layer is not None:
        shape.mesh.uv_layers.active = layer


def _set_up(scene: bpy.types.Scene) -> None:
    """Few samples and no surroundings: nothing here depends on light."""
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", _SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.view_layers[0].update()


def _show_alpha(tree: bpy.types.NodeTree) -> None:
    """Let a material emit its alpha."""
    _emit(tree, tree.get_output_node("CYCLES"), *_alpha_source(tree))


def _alpha_source(tree: bpy.types.NodeTree) -> tuple[bpy.types.NodeSocket, bool] | None:
    """Return the input that holds a material's alpha, and whether it is 1 minus that; None for a 1.

    Known are the Alpha of a Principled BSDF, and the factor of a Mix Shader with a Transparent BSDF.
    """
    output = tree.get_output_node("CYCLES")
    shader = feeder(output.inputs["Surface"]) if output else None
    if shader is None or not shader.is_output:
        return None
    node = shader.node
    inverted, source = False, None
    if node.bl_idname == "ShaderNodeBsdfPrincipled":
        source = node.inputs["Alpha"]
    elif node.bl_idname == "ShaderNodeMixShader":
        holes = [_is_transparent(socket) for socket in node.inputs[1:3]]
        source, inverted = (node.inputs[0], holes[1]) if any(holes) else (None, False)
    if source is None or (not source.is_linked and source.default_value == (0.0 if inverted else 1.0)):
        return None
    return source, inverted


def _is_transparent(socket: bpy.types.NodeSocket) -> bool:
    output = feeder(socket)
    return output.is_output and output.node.bl_idname == "ShaderNodeBsdfTransparent"


def _emit(
    tree: bpy.types.NodeTree, output: bpy.types.Node, source: bpy.types.NodeSocket, inverted: bool
) -> None:
    """Link a number, or 1 minus it, through an emission shader to the output."""
    emission = tree.nodes.new("ShaderNodeEmission")
    number = tree.nodes.new("ShaderNodeMath")
    number.operation, number.use_clamp = "MULTIPLY_ADD", True
    number.inputs[1].default_value, number.inputs[2].default_value = (-1.0, 1.0) if inverted else (1.0, 0.0)
    if source.is_linked:
        tree.links.new(source.links[0].from_socket, number.inputs[0])
    else:
        number.inputs[0].default_value = source.default_value
    tree.links.new(number.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
