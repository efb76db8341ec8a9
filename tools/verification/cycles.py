"""The reference: Cycles bakes realised copies of the objects on the same lightmap UVs."""

from __future__ import annotations

import importlib
import time
from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix

from tools.headless import MODULE
from tools.verification.strand_copies import curves_of

#: Sockets of the Principled BSDF that make light shiny: radiosity has none of it.
_SHINY = ("Specular IOR Level", "Specular", "Coat Weight", "Sheen Weight")


#: Passes of E/pi.
_LIGHT = {"DIRECT", "INDIRECT"}


@contextmanager
def realised(context: bpy.types.Context, read, resolution: int) -> Iterator[RealisedScene]:
    """Make a scene of copies: objects and instances with their places in the lightmaps, lamps, the world."""
    scene = RealisedScene(context, read, resolution)
    try:
        yield scene
    finally:
        scene.remove()


#: Flags of an object for kinds of rays, which its copy has, too.
_RAY_VISIBILITY = (
    "visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission", "visible_volume_scatter",
    "visible_shadow",
)  # fmt: skip


class RealisedScene:
    """Copies of a bake's scene, which Cycles can bake without changing the user's objects.

    seconds:  wall time of Blender's bake operator in the last bake, s
    """

    def __init__(self, context: bpy.types.Context, read, resolution: int) -> None:
        self._read = importlib.import_module(f"{MODULE}.operators.scene.objects.evaluation")
        self._context = importlib.import_module(f"{MODULE}.operators.scene.scene_context")
        self._visible = importlib.import_module(f"{MODULE}.operators.scene.objects.visible")
        self._evaluation = importlib.import_module(f"{MODULE}.operators.scene.materials.shader_bake")
        self._hair = importlib.import_module(f"{MODULE}.operators.scene.objects.strands")
        self._layers = importlib.import_module(f"{MODULE}.operators.scene.uvs.lightmap_layer")
        self._uv_layer = context.scene.hemibake.uv_layer
        self._scene = bpy.data.scenes.new("Reference")
        self._scene.world = context.scene.world
        self._override = context.view_layer.material_override
        self._atlases = read.scene.atlases
        self._images = [_image(resolution) for _ in self._atlases]
        self._anchor = bpy.data.objects.new("Anchor", None)
        self._scene.collection.objects.link(self._anchor)
        self._members: list[list[bpy.types.Object]] = [[] for _ in self._atlases]
        self._groups: dict[str, str] = {}
        self._copies_by_name: dict[str, tuple[bpy.types.Object, int]] = {}
        self._materials: dict[tuple, bpy.types.Material] = {}
        self._made: list = []
        self.seconds = 0.0
        places = dict(read.objects)
        places |= {(uid, number): place for uid, _, number, place in read.instances}
        visible = {obj.session_uid for obj in self._visible.visible_objects(context)}
        where = self._context.SceneContext(context)
        for item, copy in self._read.evaluate(where, lambda evaluation: self._copies(evaluation, visible)):
            if copy is None:
                self._add(item, item.source.data.copy())
            elif isinstance(copy, bpy.types.Mesh):
                key = (
                    item.source.session_uid
                    if item.instancer is None
                    else (item.instancer.session_uid, item.persistent_id)
                )
                self._add_mesh(item, copy, places.get(key))
            else:
                self._add_strands(item, copy)

    def bake(self, samples: int, seed: int, device: str = "CPU", persistent: bool = False) -> np.ndarray:
        """Return E/pi of every atlas, (atlases, h, w, 4) float32; alpha is 0 where nothing is baked.

        device:      "CPU" or "GPU", as in Cycles
        persistent:  True lets Cycles keep its scene between bakes
        """
        remove_bias(self._scene, samples, seed)
        self._scene.cycles.device, self._scene.render.use_persistent_data = device, persistent
        self.seconds = 0.0
        return np.stack(
            [
                self._bake_atlas(image, objects)
                for image, objects in zip(self._images, self._members, strict=True)
            ]
        )

    def keep_group(self, name: str) -> None:
        """Switch off the world and all lights that are not in a light group."""
        for obj in self._scene.collection.objects:
            obj.hide_render = obj.type == "LIGHT" and self._groups[obj.name] != name
        if self._scene.world is not None and self._scene.world.lightgroup != name:
            self._scene.world = None

    def bake_strip(
        self, name: str, corner: np.ndarray, along: np.ndarray, away: np.ndarray, samples: int, seed: int
    ) -> np.ndarray:
        """Return E/pi on a rectangle of an object's flat surface, (h, w, 3) float32: rows go along `away`.

        corner, along, away:  (3,) float64, m, one corner of the rectangle and its sides
        """
        remove_bias(self._scene, samples, seed)
        obj, atlas = self._copies_by_name[name]
        mesh, normal = obj.data, np.cross(along, away)
        positions = np.array([tuple(obj.matrix_world @ vertex.co) for vertex in mesh.vertices])
        uvs = np.stack([(positions - corner) @ side / (side @ side) for side in (along, away)], axis=1)
        off = np.abs((positions - corner) @ normal) > 1e-4 * np.linalg.norm(normal)
        layer = mesh.uv_layers[self._evaluation.LIGHTMAP_UVS]
        for polygon in mesh.polygons:
            beside = off[list(polygon.vertices)].any()
            for loop, vertex in zip(polygon.loop_indices, polygon.vertices, strict=True):
                layer.uv[loop].vector = (-9, -9) if beside else uvs[vertex]
        return self._bake_atlas(self._images[atlas], [obj])[..., :3]

    def covers(self, name: str) -> np.ndarray:
        """Return the texels, (atlases, h, w) bool, whose centres lie on an object's surface."""
        remove_bias(self._scene, 1, 1)
        obj, atlas = self._copies_by_name[name]
        covered = np.zeros((len(self._images), *reversed(self._images[0].size)), bool)
        covered[atlas] = self._bake_atlas(self._images[atlas], [obj], {"COLOR"})[..., 3] > 0
        return covered

    def bake_mesh(self, mesh: bpy.types.Mesh, image: bpy.types.Image, samples: int, seed: int) -> np.ndarray:
        """Return E/pi on an additional mesh, (h, w, 4) float32, by its lightmap UVs; others do not see it."""
        remove_bias(self._scene, samples, seed)
        obj = bpy.data.objects.new(mesh.name, mesh)
        for name in _RAY_VISIBILITY:
            # Cycles bakes nothing on objects that the camera cannot see.
            setattr(obj, name, name == "visible_camera")
        material = _grey()
        node = material.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        material.node_tree.nodes.active = node
        mesh.materials.append(material)
        self._scene.collection.objects.link(obj)
        self._scene.view_layers[0].update()
        try:
            return self._bake_atlas(image, [obj])
        finally:
            bpy.data.objects.remove(obj)
            bpy.data.meshes.remove(mesh)
            bpy.data.materials.remove(material)

    def colour(self) -> np.ndarray:
        """Return the reflectance of the surfaces, (atlases, h, w, 3); Cycles gives no light where it is 0."""
        remove_bias(self._scene, 4, 1)
        members = zip(self._images, self._members, strict=True)
        return np.stack([self._bake_atlas(image, objects, {"COLOR"})[..., :3] for image, objects in members])

    def remove(self) -> None:
        """Remove all copies."""
        for obj in list(self._scene.collection.objects):
            bpy.data.objects.remove(obj)
        bpy.data.scenes.remove(self._scene)
        for collection, data in self._made:
            collection.remove(data)
        for material in self._materials.values():
            bpy.data.materials.remove(material)
        for image in self._images:
            bpy.data.images.remove(image)

    def _add(self, item, data) -> bpy.types.Object:
        obj = bpy.data.objects.new(item.source.name, data)
        self._groups[obj.name] = item.source.lightgroup
        for name in _RAY_VISIBILITY:
            setattr(obj, name, getattr(item.source, name))
        self._made.append((_collection_of(data), data))
        self._scene.collection.objects.link(obj)
        obj.parent = self._anchor
        obj.matrix_parent_inverse = Matrix(item.matrix.tolist())
        return obj

    def _add_mesh(self, item, mesh: bpy.types.Mesh, place) -> None:
        """Add a copy of an evaluated mesh; one with a place is a member of its atlas."""
        obj = self._add(item, mesh)
        atlas = None if place is None else self._atlases.index(place.atlas)
        materials = self._worn(item, mesh)
        while len(mesh.materials) < len(materials):
            mesh.materials.append(None)
        for index, material in enumerate(materials):
            mesh.materials[index] = self._material(material, atlas)
        if atlas is None:
            return
        layer = self._layers.lightmap_layer(item.source, self._uv_layer)
        self._evaluation.add_lightmap_uv_map(mesh, layer, place.apply)
        self._members[atlas].append(obj)
        self._copies_by_name[item.source.name] = obj, atlas

    def _copies(self, evaluation, visible: set[int]) -> list[tuple]:
        """Return lamps with None, and visible meshes and hair with copies of their data."""
        copies: list[tuple] = []
        for item in evaluation.items(visible, with_hair=True):
            depsgraph = evaluation.depsgraph_of(item)
            if self._hair.has_strands(item.object, depsgraph):
                copies += [(item, strands) for strands in self._hair.read_strands(item.object, depsgraph)]
            if not item.shows_self or _ignored(item):
                continue
            if item.object.type == "LIGHT":
                copies.append((item, None))
            elif item.object.type == "MESH":
                mesh = bpy.data.meshes.new_from_object(
                    item.object, preserve_all_data_layers=True, depsgraph=depsgraph
                )
                copies.append((item, mesh))
        return copies

    def _add_strands(self, item, strands) -> None:
        """Add hair as Curves, which Cycles renders as it renders hair."""
        data = curves_of(strands)
        slots = item.source.material_slots
        worn = slots[min(strands.slot, len(slots) - 1)].material if slots else None
        data.materials.append(self._material(self._override or worn, None))
        self._add(item, data)

    def _worn(self, item, mesh: bpy.types.Mesh) -> list[bpy.types.Material | None]:
        """Return the materials of an item's slots."""
        materials = [material and material.original for material in mesh.materials]
        for index, slot in enumerate(item.source.material_slots):
            if slot.link == "OBJECT" and index < len(materials):
                materials[index] = slot.material
        materials = materials or [None]
        return [self._override] * len(materials) if self._override else materials

    def _material(self, material: bpy.types.Material | None, atlas: int | None) -> bpy.types.Material:
        """Return a diffuse copy of a material that bakes into the image of an atlas."""
        key = (material, atlas)
        if key not in self._materials:
            copy = _grey() if material is None else material.copy()
            self._materials[key] = copy
            for node in copy.node_tree.nodes:
                if node.bl_idname == "ShaderNodeBsdfPrincipled":
                    _make_dull(copy.node_tree, node)
            if copy.displacement_method != "BUMP":
                _make_flat(copy.node_tree)
            node = copy.node_tree.nodes.new("ShaderNodeTexImage")
            node.image = self._images[atlas or 0]
            copy.node_tree.nodes.active = node
        return self._materials[key]

    def _bake_atlas(
        self, image: bpy.types.Image, objects: list[bpy.types.Object], passes: set[str] = _LIGHT
    ) -> np.ndarray:
        image.pixels.foreach_set(np.zeros(len(image.pixels), np.float32))
        layer = self._scene.view_layers[0]
        override = {
            "scene": self._scene, "view_layer": layer, "active_object": objects[0], "object": objects[0],
            "selected_objects": objects, "selected_editable_objects": objects,
        }  # fmt: skip
        started = time.perf_counter()
        with bpy.context.temp_override(**override):
            bpy.ops.object.bake(
                type="DIFFUSE", pass_filter=passes, margin=0, use_clear=False,
                uv_layer=self._evaluation.LIGHTMAP_UVS,
            )  # fmt: skip
        self.seconds += time.perf_counter() - started
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(*reversed(image.size), 4)


def _ignored(item) -> bool:
    roles = {item.source.hemibake.role, item.instancer.hemibake.role if item.instancer else "BAKED"}
    return not roles.isdisjoint({"IGNORED", "DYNAMIC"})


def _image(resolution: int) -> bpy.types.Image:
    return bpy.data.images.new(
        "Reference", resolution, resolution, alpha=True, float_buffer=True, is_data=True
    )


def _collection_of(data: bpy.types.ID) -> bpy.types.bpy_prop_collection:
    """Return the collection of bpy.data that holds a copy."""
    if isinstance(data, bpy.types.Light):
        return bpy.data.lights
    return bpy.data.meshes if isinstance(data, bpy.types.Mesh) else bpy.data.hair_curves


def _grey() -> bpy.types.Material:
    """Return the material that Cycles displays where there is no material."""
    material = bpy.data.materials.new("Grey")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.8, 0.8, 1)
    return material


def _make_dull(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Switch off glossy reflection."""
    for name in _SHINY:
        socket = node.inputs.get(name)
        if socket is not None:
            for link in list(socket.links):
                tree.links.remove(link)
            socket.default_value = 0.0


def _make_flat(tree: bpy.types.NodeTree) -> None:
    """Remove true displacement, which bakes name as not baked."""
    for link in list(tree.get_output_node("CYCLES").inputs["Displacement"].links):
        tree.links.remove(link)


def remove_bias(scene: bpy.types.Scene, samples: int, seed: int) -> None:
    """Remove every bias of Cycles: clamping, short paths, filtered caustics, denoising, light thresholds."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.transparent_max_bounces = 64
    cycles.glossy_bounces = cycles.transmission_bounces = 64
    cycles.blur_glossy = 0.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = 0.0
    scene.view_layers[0].update()
