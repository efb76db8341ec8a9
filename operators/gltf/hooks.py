"""What Blender's glTF exporter calls: it gives meshes their lightmap UVs, and materials their lightmaps.

The exporter has then gathered meshes, materials and textures as objects of its own: nothing of the scene is
touched. Each node gets a mesh of its own, since objects of one mesh have different places in lightmaps, of
which everything but the second UV set is shared.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence

import bpy
import numpy as np
from io_scene_gltf2.io.com import gltf2_io
from mathutils import Matrix, Quaternion

from .encoded import EncodedLightmap
from .export_items import ExportItem, ExportItems, GltfUvTransform
from .materials import LitMaterials

#: From Blender's axes, z up, to those of glTF, y up.
_Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


class LightmapHooks:
    """The exporter's hooks, by the names that it has for them.

    lit    surfaces of the file that have lightmaps
    dark   names of the objects whose surfaces have none
    lost   names of those without the UV layer of their lightmap
    error  what went wrong: the exporter itself would go on
    """

    def __init__(
        self,
        surfaces: ExportItems,
        lightmaps: Mapping[bpy.types.Image, EncodedLightmap],
        materials: LitMaterials,
    ) -> None:
        self._surfaces, self._lightmaps, self._materials = surfaces, lightmaps, materials
        self._layers: dict[int, tuple[gltf2_io.Mesh, list[str]]] = {}
        self.lit: list[ExportItem] = []
        self.dark: list[str] = []
        self.lost: list[str] = []
        self.error: Exception | None = None

    def gather_tree_filter_tag_hook(self, tree: object, *others: object) -> None:
        """Leave out instances on vertices and faces where the exporter has them again, as those of nodes."""
        for entry in tree.nodes.values():
            if entry.blender_object is None and entry.original_object.instance_type != "NONE":
                entry.keep_tag = False

    def gather_mesh_hook(self, mesh: gltf2_io.Mesh, made_of: bpy.types.Mesh, *others: object) -> None:
        """Remember which UV layers a mesh has: its UV sets have no names."""
        self._layers[id(mesh)] = mesh, [layer.name for layer in made_of.uv_layers]

    def gather_gltf_hook(self, active: int, scenes: Sequence[gltf2_io.Scene], *others: object) -> None:
        """Light the nodes of all scenes."""
        tree = others[-1]["vtree"]
        entries = {id(entry.node): entry for entry in tree.nodes.values() if entry.node is not None}
        try:
            for node, matrix in _nodes(scenes):
                entry = entries.get(id(node))
                if entry is not None and node.mesh is not None:
                    self._light(node, entry, np.array(_Y_UP.inverted() @ matrix @ _Y_UP))
        except Exception as error:  # noqa: BLE001
            self.error = error

    def _light(self, node: gltf2_io.Node, entry: object, matrix: np.ndarray) -> None:
        """Give a node the lightmap of the surface that it shows."""
        if entry.blender_object is not None:
            surface = self._surfaces.of_object(entry.blender_object.original, matrix)
        else:
            surface = self._surfaces.of_mesh(entry.data.name, matrix)
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

    def _lit_primitive(
        self,
        primitive: gltf2_io.MeshPrimitive,
        place: GltfUvTransform,
        lightmap: EncodedLightmap,
        number: int,
    ) -> gltf2_io.MeshPrimitive:
        """Return a primitive whose second UV set is that of the lightmap, which is in one of some number.

        One without UVs, as of loose edges, stays as it is.
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


def _name(entry: object) -> str:
    """Return the name of the object that an entry of the exporter's tree shows, or that makes it."""
    return (entry.blender_object or entry.original_object).name


def _moved(accessor: gltf2_io.Accessor, place: GltfUvTransform) -> gltf2_io.Accessor:
    """Return UVs as a place in a lightmap has them; v of glTF points down."""
    uvs = np.frombuffer(accessor.buffer_view.data, np.float32).reshape(-1, 2) * (1, -1) + (0, 1)
    moved = np.ascontiguousarray(place.apply(uvs) * (1, -1) + (0, 1), np.float32)
    made = copy.copy(accessor)
    made.buffer_view = type(accessor.buffer_view)(moved.tobytes(), accessor.buffer_view.bufferViewTarget)
    return made


def _nodes(scenes: Sequence[gltf2_io.Scene]) -> Iterator[tuple[gltf2_io.Node, Matrix]]:
    """Yield all nodes, each with its matrix from object space to world space, y up."""
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
