"""Digests of the input of Cycles' evaluations: equal digests mean equal pixels.

Digests cover the content of datablocks and not their identity, so that an undo, a copy or another file cannot
return outdated pixels. Input that cannot be read, or may change by itself, has no digest.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

from ...working_space import working_space
from ..objects.meshes import read_array

if TYPE_CHECKING:
    from .shader_bake import EvaluatedMesh

#: Properties of nodes without influence on the result: display, ownership.
_IGNORED = frozenset({
    "rna_type", "parent", "internal_links", "inputs", "outputs", "name", "label", "location", "id_data",
    "location_absolute", "width", "height", "dimensions", "select", "hide", "color", "use_custom_color",
    "show_options", "show_preview", "show_texture", "color_tag", "warning_propagation", "paired_output",
    "bl_icon", "bl_description", "bl_label", "image_user",
})  # fmt: skip

#: Nodes that depend on more than the material and the mesh: files, scripts, the scene.
_UNKNOWN = frozenset({"ShaderNodeScript", "ShaderNodeTexIES", "ShaderNodeTexPointDensity"})

#: Sources of images that do not change by themselves. Images with more floats than the second value have no
#: digest.
_STILL = frozenset({"FILE", "GENERATED"})
_LARGEST = 1 << 26

#: Attribute types: property that holds an element's value, and numbers per element.
_ATTRIBUTES = {
    "FLOAT": ("value", 1), "INT": ("value", 1), "BOOLEAN": ("value", 1), "INT8": ("value", 1),
    "FLOAT_VECTOR": ("vector", 3), "FLOAT2": ("vector", 2), "FLOAT_COLOR": ("color", 4),
    "BYTE_COLOR": ("color", 4), "QUATERNION": ("value", 4), "INT32_2D": ("value", 2),
    "INT16_2D": ("value", 2),
}  # fmt: skip


class _Digest:
    """A digest under construction, which contains each node group once.

    trees:  number of each node tree in it, by its address
    """

    def __init__(self, start: bytes) -> None:
        self._hash = hashlib.blake2b(start)
        self.trees: dict[int, int] = {}

    def update(self, data: bytes | memoryview) -> None:
        """Add bytes."""
        self._hash.update(data)

    def value(self) -> bytes:
        """Return the digest."""
        return self._hash.digest()


class UnknownError(Exception):
    """Raised for content of a material or mesh that may change unnoticed."""


def evaluation_digest(
    material: bpy.types.Material,
    shapes: Sequence[EvaluatedMesh],
    values: Iterable[object],
    size: int,
    glass: bool,
) -> bytes | None:
    """Return a digest of a material and the meshes it is evaluated on; None if it may change unnoticed.

    values:  values of object-dependent nodes
    size:    width of the textures, texels
    glass:   True if refracting closures transmit light without refraction
    """
    digest = _Digest(repr((working_space(), size, list(values), glass)).encode())
    try:
        _feed_tree(digest, material.node_tree)
        for shape in shapes:
            worn = [slot == material for slot in shape.slots]
            _feed(digest, [shape.uv_layer, worn, np.array(shape.matrix), shape.rest])
            _feed_mesh(digest, shape.mesh)
        if material.animation_data is not None:
            raise UnknownError
    except UnknownError:
        return None
    return digest.value()


def world_digest(world: bpy.types.World) -> bytes | None:
    """Return a digest of the nodes and name of a world; None if they may change unnoticed."""
    digest = _Digest(repr((working_space(), world.name)).encode())
    try:
        if world.animation_data is not None:
            raise UnknownError
        _feed_tree(digest, world.node_tree)
    except UnknownError:
        return None
    return digest.value()


def _feed(digest: _Digest, values: Iterable[object]) -> None:
    """Add arrays, numbers and names to a digest."""
    for value in values:
        if isinstance(value, np.ndarray):
            digest.update(repr((value.shape, value.dtype.str)).encode())
            digest.update(np.ascontiguousarray(value).data)
        else:
            digest.update(repr(value).encode())


def _feed_tree(digest: _Digest, tree: bpy.types.NodeTree) -> None:
    """Add the nodes of a tree and their links to a digest; of a tree that is in it, add the number only."""
    known = tree.as_pointer() in digest.trees
    _feed(digest, [digest.trees.setdefault(tree.as_pointer(), len(digest.trees))])
    if known:
        return
    if tree.animation_data is not None:
        raise UnknownError
    index = {node.name: number for number, node in enumerate(tree.nodes)}
    for node in tree.nodes:
        if node.bl_idname in _UNKNOWN or getattr(node, "attribute_type", "") == "VIEW_LAYER":
            raise UnknownError
        _feed_struct(digest, node)
        for socket in (*node.inputs, *node.outputs):
            _feed(digest, [socket.identifier, socket.type, socket.enabled])
            _feed(digest, [_plain(getattr(socket, "default_value", None))])
    for link in tree.links:
        ends = (link.from_node, link.to_node)
        sockets = link.from_socket.identifier, link.to_socket.identifier
        _feed(digest, [*(index[node.name] for node in ends), *sockets, link.is_muted, link.is_valid])


def _feed_struct(digest: _Digest, struct: bpy.types.bpy_struct) -> None:
    """Add the properties of a node, or of a part of it such as a colour ramp, to a digest."""
    for prop in struct.bl_rna.properties:
        if prop.identifier in _IGNORED:
            continue
        value = getattr(struct, prop.identifier)
        digest.update(prop.identifier.encode())
        if prop.type == "COLLECTION":
            for item in value:
                _feed_struct(digest, item)
        elif prop.type == "POINTER" and value is not None:
            _feed_pointer(digest, value)
        else:
            _feed(digest, [_plain(value)])


def _feed_pointer(digest: _Digest, value: bpy.types.bpy_struct) -> None:
    """Add the datablock that a node refers to to a digest; raises UnknownError for unknown types."""
    if isinstance(value, bpy.types.Image):
        _feed_image(digest, value)
    elif isinstance(value, bpy.types.NodeTree):
        _feed_tree(digest, value)
    elif isinstance(value, bpy.types.Object):
        _feed(digest, [np.array(value.matrix_world)])
    elif isinstance(value, bpy.types.ID | bpy.types.Node):
        raise UnknownError
    else:
        _feed_struct(digest, value)


def _feed_image(digest: _Digest, image: bpy.types.Image) -> None:
    """Add the pixels of an image and their encoding to a digest."""
    width, height = image.size
    numbers = width * height * image.channels
    if image.source not in _STILL or not 0 < numbers <= _LARGEST:
        raise UnknownError
    pixels = np.empty(numbers, np.float32)
    image.pixels.foreach_get(pixels)
    _feed(digest, [width, height, image.channels, image.colorspace_settings.name, image.alpha_mode])
    _feed(digest, [image.is_float, pixels])


def _feed_mesh(digest: _Digest, mesh: bpy.types.Mesh) -> None:
    """Add all of a mesh that shaders can read to a digest: topology, normals and attributes."""
    faces, corners = mesh.polygons, mesh.loops
    for collection, name in ((faces, "loop_start"), (faces, "loop_total"), (faces, "material_index")):
        _feed(digest, [read_array(collection, name, 1, np.int32)])
    _feed(digest, [read_array(corners, "vertex_index", 1, np.int32)])
    _feed(digest, [read_array(mesh.corner_normals, "vector", 3, np.float32)])
    _feed(digest, [tuple(mesh.texspace_location), tuple(mesh.texspace_size)])
    for layer in mesh.uv_layers:
        _feed(digest, [layer.name, layer.active_render])
    _feed(digest, [mesh.color_attributes.render_color_index])
    for attribute in mesh.attributes:
        _feed(digest, [attribute.name, attribute.domain, attribute.data_type])
        if attribute.data_type not in _ATTRIBUTES:
            raise UnknownError
        name, width = _ATTRIBUTES[attribute.data_type]
        kind = np.float32 if attribute.data_type in _FLOATS else np.int32
        _feed(digest, [read_array(attribute.data, name, width, kind)])


#: Types of attributes stored as float32.
_FLOATS = frozenset({"FLOAT", "FLOAT_VECTOR", "FLOAT2", "FLOAT_COLOR", "BYTE_COLOR", "QUATERNION"})


def _plain(value: Any) -> object:
    """Return a property's value as a built-in type; raises UnknownError for a datablock."""
    if isinstance(value, bpy.types.bpy_struct):
        raise UnknownError
    return tuple(value) if hasattr(value, "__len__") and not isinstance(value, str | set) else value
