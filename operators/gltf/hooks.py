"""Hooks of Blender's glTF exporter: they set lightmap UVs of meshes and lightmaps of materials.

They run after the exporter has gathered meshes, materials and textures as objects of its own, so that the
scene is not changed. Each node gets a mesh of its own, because objects with one mesh have different places in
lightmaps. Such meshes share all data except the second UV set.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import bpy
import numpy as np
from io_scene_gltf2.io.com import gltf2_io
from mathutils import Matrix, Quaternion

from ..result.vertex_light import COLORS
from .clear_materials import blend_clear_materials
from .encoded import EncodedLightmap
from .export_items import ExportItem, ExportItems, GltfUvTransform
from .materials import LitMaterials, UnlitMaterials
from .vertex_colors import LIGHT, light_colors

#: Rotation from Blender's axes (z up) to glTF's axes (y up).
_Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class LightmapHooks:
    """Hooks under the names that the exporter looks for.

    lit:       surfaces in the file that have lightmaps
    nodes:     index of the node of each of them in the file
    colored:   surfaces in the file with light as vertex colors
    emitting:  names of objects among these whose materials emit light
    dark:      names of objects with surfaces that have none
    lost:      names of objects whose mesh lacks the UV layer of their lightmap
    textured:  names of materials with textured transmission, which stay opaque where glass is blended
    error:     exception of a hook, since the exporter itself would go on
    """

    def __init__(
        self,
        surfaces: ExportItems,
        lightmaps: Mapping[bpy.types.Image, EncodedLightmap],
        materials: LitMaterials,
        extras: Mapping[str, object],
        blends: bool = False,
    ) -> None:
        """Create the hooks.

        surfaces:   surfaces of the scene
        lightmaps:  encoded lightmap of each image
        materials:  materials of the file
        extras:     version, light groups and states for the asset's extras
        blends:     True to replace transmission by alpha blending
        """
        self._blends, self.textured = blends, list[str]()
        self._surfaces, self._lightmaps, self._materials = surfaces, lightmaps, materials
        self._extras = extras
        self._layers: dict[int, tuple[gltf2_io.Mesh, list[str]]] = {}
        self._colors: dict[int, tuple[gltf2_io.MeshPrimitive, gltf2_io.Accessor, bool]] = {}
        self.lit: list[ExportItem] = []
        self.colored: list[ExportItem] = []
        self.emitting: list[str] = []
        self.nodes: list[int] = []
        self._lit_nodes: list[gltf2_io.Node] = []
        self.dark: list[str] = []
        self.lost: list[str] = []
        self.error: Exception | None = None

    def gather_asset_hook(self, asset: gltf2_io.Asset, *others: object) -> None:
        """Add version, light groups and states to the asset's extras, if there are any."""
        if self._extras:
            asset.extras = {**(asset.extras or {}), "hemibake": dict(self._extras)}

    def gather_tree_filter_tag_hook(self, tree: Any, *others: object) -> None:
        """Remove instances on vertices and faces that the exporter lists twice."""
        for entry in tree.nodes.values():
            if entry.blender_object is None and entry.original_object.instance_type != "NONE":
                entry.keep_tag = False

    @property
    def needs_attributes(self) -> bool:
        """True if the hooks need the colors of meshes."""
        return self._surfaces.on_vertices

    def gather_attribute_keep(self, attribute: Any, *others: object) -> None:
        """Export the light of vertices, under a name of its own, and no other attribute."""
        attribute.keep = attribute.attr_name == COLORS
        attribute.attr_name = LIGHT if attribute.keep else attribute.attr_name

    def gather_mesh_hook(self, mesh: gltf2_io.Mesh, made_of: bpy.types.Mesh, *others: object) -> None:
        """Record the names of a mesh's UV layers, which glTF does not store; take its vertex light out."""
        self._layers[id(mesh)] = mesh, [layer.name for layer in made_of.uv_layers]
        paints = made_of.color_attributes.default_color_name not in ("", COLORS)
        for primitive in mesh.primitives:
            light = primitive.attributes.pop(LIGHT, None)
            if light is not None:
                self._colors[id(primitive)] = primitive, light, paints

    def gather_gltf_hook(self, active: int, scenes: Sequence[gltf2_io.Scene], *others: Any) -> None:
        """Add lightmaps to the nodes of all scenes."""
        tree = others[-1]["vtree"]
        entries = {id(entry.node): entry for entry in tree.nodes.values() if entry.node is not None}
        try:
            for node, matrix in _nodes(scenes):
                entry = entries.get(id(node))
                if entry is not None and node.mesh is not None:
                    self._light(node, entry, np.array(_Y_UP.inverted() @ matrix @ _Y_UP))
            if self._blends:
                self.textured = blend_clear_materials(_materials(scenes))
        except Exception as error:  # noqa: BLE001
            self.error = error

    def gather_gltf_extensions_hook(self, gltf: gltf2_io.Gltf, *others: object) -> None:
        """Record the indices of nodes, which the exporter has written to its lists."""
        places = {id(node): index for index, node in enumerate(gltf.nodes)}
        self.nodes = [places[id(node)] for node in self._lit_nodes]

    def _light(self, node: gltf2_io.Node, entry: Any, matrix: np.ndarray) -> None:
        """Assign the lightmap of its surface to a node: a mesh of its own with lightmap UVs and materials."""
        if entry.blender_object is not None:
            surface = self._surfaces.of_object(entry.blender_object.original, matrix)
        else:
            surface = self._surfaces.of_mesh(entry.data.name, matrix)
        if surface is not None and surface.on_vertices:
            self._color(node, surface)
            return
        if surface is None or surface.place is None:
            self.dark.append(_name(entry) if surface is None else surface.source.name)
            return
        if surface.place.image not in self._lightmaps:
            return
        _, layers = self._layers.get(id(node.mesh), (node.mesh, ()))
        if surface.place.layer not in layers:
            self.lost.append(surface.source.name)
            return
        lightmap, number = self._lightmaps[surface.place.image], layers.index(surface.place.layer)
        node.mesh = copy.copy(node.mesh)
        node.mesh.primitives = [
            self._lit_primitive(primitive, surface.place, lightmap, number)
            for primitive in node.mesh.primitives
        ]
        self.lit.append(surface)
        self._lit_nodes.append(node)

    def _color(self, node: gltf2_io.Node, surface: ExportItem) -> None:
        """Assign the light of its vertices to a node: a mesh of its own with colors and unlit materials."""
        if not any(id(primitive) in self._colors for primitive in node.mesh.primitives):
            self.dark.append(surface.source.name)
            return
        if any(any(part.material.emissive_factor or ()) for part in node.mesh.primitives if part.material):
            self.emitting.append(surface.source.name)
        node.mesh = copy.copy(node.mesh)
        node.mesh.primitives = [self._colored_primitive(primitive) for primitive in node.mesh.primitives]
        self.colored.append(surface)

    def _colored_primitive(self, primitive: gltf2_io.MeshPrimitive) -> gltf2_io.MeshPrimitive:
        """Return a primitive with the light of its vertices as color; unchanged without any."""
        if id(primitive) not in self._colors:
            return primitive
        _, light, paints = self._colors[id(primitive)]
        made = copy.copy(primitive)
        color = light_colors(light, primitive.attributes.get("COLOR_0") if paints else None)
        made.attributes = {**primitive.attributes, "COLOR_0": color}
        made.material = self._materials.colored(primitive.material)
        return made

    def _lit_primitive(
        self,
        primitive: gltf2_io.MeshPrimitive,
        place: GltfUvTransform,
        lightmap: EncodedLightmap,
        number: int,
    ) -> gltf2_io.MeshPrimitive:
        """Return a primitive with the lightmap's UVs, which are in UV set `number`, as the second UV set.

        A primitive without UVs, as for loose edges, is returned unchanged.
        """
        made = copy.copy(primitive)
        sets, first = dict(primitive.attributes), f"TEXCOORD_{number}"
        if first not in sets:
            return made
        moved = _moved(sets[first], place)
        if "TEXCOORD_1" in sets:
            sets[first] = sets["TEXCOORD_1"]
        made.attributes = {**sets, "TEXCOORD_1": moved}
        swapped = number if "TEXCOORD_1" in primitive.attributes else 1
        made.material = self._materials.lit(primitive.material, lightmap, swapped)
        return made


class UnlitHooks(LightmapHooks):
    """Hooks that show complete maps: lightmap UVs as the only UV set, and unlit materials.

    clear:  names of objects with a transparent material, which become opaque
    """

    _materials: UnlitMaterials

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.clear: list[str] = []

    def _light(self, node: gltf2_io.Node, entry: object, matrix: np.ndarray) -> None:
        materials = [primitive.material for primitive in node.mesh.primitives]
        lit = len(self.lit)
        super()._light(node, entry, matrix)
        is_clear = any(material and material.alpha_mode in ("BLEND", "MASK") for material in materials)
        if len(self.lit) > lit and is_clear and self.lit[-1].source.name not in self.clear:
            self.clear.append(self.lit[-1].source.name)

    def _lit_primitive(
        self,
        primitive: gltf2_io.MeshPrimitive,
        place: GltfUvTransform,
        lightmap: EncodedLightmap,
        number: int,
    ) -> gltf2_io.MeshPrimitive:
        """Return a primitive with the lightmap's UVs as its only UV set, without colors."""
        made = copy.copy(primitive)
        sets, first = primitive.attributes, f"TEXCOORD_{number}"
        if first not in sets:
            return made
        kept = {name: part for name, part in sets.items() if not name.startswith(("TEXCOORD_", "COLOR_"))}
        made.attributes = {**kept, "TEXCOORD_0": _moved(sets[first], place)}
        made.material = self._materials.unlit(primitive.material, lightmap)
        return made


def _name(entry: Any) -> str:
    """Return the object's name of an entry in the exporter's tree; for an instance, its instancer's name."""
    return (entry.blender_object or entry.original_object).name


def _moved(accessor: gltf2_io.Accessor, place: GltfUvTransform) -> gltf2_io.Accessor:
    """Return UVs transformed to their place in the lightmap; v points down in glTF."""
    uvs = np.frombuffer(accessor.buffer_view.data, np.float32).reshape(-1, 2) * (1, -1) + (0, 1)
    moved = np.ascontiguousarray(place.apply(uvs) * (1, -1) + (0, 1), np.float32)
    made = copy.copy(accessor)
    made.buffer_view = type(accessor.buffer_view)(moved.tobytes(), accessor.buffer_view.bufferViewTarget)
    return made


def _materials(scenes: Sequence[gltf2_io.Scene]) -> list[gltf2_io.Material]:
    """Return each material of the meshes of all scenes once."""
    meshes = [node.mesh for node, _ in _nodes(scenes) if node.mesh is not None]
    used = [primitive.material for mesh in meshes for primitive in mesh.primitives]
    return list({id(material): material for material in used if material is not None}.values())


def _nodes(scenes: Sequence[gltf2_io.Scene]) -> Iterator[tuple[gltf2_io.Node, Matrix]]:
    """Yield all nodes with their matrices from object space to world space, y up."""
    open_ends = [(node, Matrix()) for scene in scenes for node in scene.nodes]
    while open_ends:
        node, parent = open_ends.pop()
        matrix = parent @ _local(node)
        yield node, matrix
        open_ends += [(child, matrix) for child in node.children or ()]


def _local(node: gltf2_io.Node) -> Matrix:
    x, y, z, w = node.rotation or (0, 0, 0, 1)
    return Matrix.LocRotScale(
        node.translation or (0, 0, 0), Quaternion((w, x, y, z)), node.scale or (1, 1, 1)
    )
