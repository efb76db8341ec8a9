"""Table of the materials of a bake: each is read once, or evaluated by Cycles if it cannot be read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ....engine.object_message import listing
from ....engine.scene.model import Material
from ...compat import node_tree
from ...lookup import find, find_all
from ..objects.evaluation import Evaluation
from ..objects.items import Hidden, ItemKey, SceneItem, hidden_from
from ..objects.meshes import LIGHTMAP_UVS
from ..scene_watch import SceneWatch
from ..slice_timer import Slices
from ..uvs.lightmap_layer import lightmap_layer
from ..uvs.uv_modifier import uv_source
from .closures import glass_fresnel, has_refraction, is_hair
from .engine_materials import block_shadow_rays, hide_from_rays, textures_of
from .evaluated_materials import EvaluatedMaterial
from .evaluated_passes import COVERED, Pixels, finish_passes, passes_of
from .evaluation_cache import kept_evaluations
from .evaluation_digest import evaluation_digest
from .materials import read_material
from .mean_colors import mean_color
from .normal_map_reflectance import surface_bumps
from .object_nodes import Dependence, FrozenCopy, Source, dependence, lost_attributes, object_values
from .pixels import PixelCache, PixelsNeededError
from .shader_bake import (
    EvaluatedMesh,
    Move,
    add_lightmap_uv_map,
    bake_pass,
    copy_shape,
    remove_shapes,
    rest_positions,
    texture_size,
)
from .sockets import ComplexError
from .strand_material import without_textures
from .surface_notes import SurfaceNotes
from .tree_nodes import used_nodes, uses_generated
from .unphysical import INVALID_VALUES, invalid_images, note_pixels

_BLOCKING = (
    "Materials {} have no Transparent Shadows: in bakes, light of emissive faces and textured worlds passes "
    "them; Cycles blocks a part of it. Switch Transparent Shadows on."
)


@dataclass(frozen=True)
class _Unevaluated:
    """A material that only Cycles can evaluate.

    uid:     session uid of the material
    values:  values of the object that uses it, see `object_nodes.object_values`
    bumps:   factor of its reflectance for its normal map, which Cycles evaluates without, see `bump_factor`
    node:    name of the first node that cannot be read
    """

    uid: int
    values: dict[Source, tuple[float, ...]]
    bumps: float
    node: str


class MaterialTable:
    """Collects the materials of all objects while the objects are read.

    watch:     the scene that is read
    uv_layer:  name of the lightmap UV layer
    several:   session uids of UV sources that several objects or instances may share, see
               `multi_user_sources`
    notes:     sentences for the user are appended here
    cache:     pixels of the images of all materials
    glass:     True if refracting closures transmit light without refraction
    """

    def __init__(
        self,
        watch: SceneWatch,
        uv_layer: str,
        several: set[int],
        notes: list[str],
        cache: PixelCache,
        glass: bool,
    ) -> None:
        self._watch, self._uv_layer, self._several = watch, uv_layer, several
        self._notes, self._cache = notes, cache
        self._index: dict[tuple, int] = {}
        self._materials: list[Material] = []
        self._complex: dict[int, _Unevaluated] = {}
        self._dependence: dict[int, Dependence] = {}
        self._lost: dict[str, dict[str, None]] = {}
        self._wearers: dict[ItemKey, tuple[int, ...]] = {}
        self._unmapped: set[int] = set()
        self._averaged: list[str] = []
        self._hair_materials: list[str] = []
        self._glass, self._surface_notes = glass, SurfaceNotes(glass)
        self._hidden: dict[int, Hidden] = {}
        self._blocking: set[int] = set()
        self._rest: dict[ItemKey, np.ndarray | None] | None = None
        self._checked_images: set[int] = set()

    def index(self, material: bpy.types.Material | None, atlas: str | None, item: SceneItem) -> int:
        """Return the index in `Scene.materials` of a material on an object of an atlas (None: an occluder).

        Raises PixelsNeededError if an image must be read first.
        """
        depends = self._depends(material)
        values = object_values(depends.sources, item)
        if material is not None:
            for name in lost_attributes(values, item):
                self._lost.setdefault(name, {})[material.name] = None
        hidden = hidden_from(item)
        key = (None if material is None else material.session_uid, tuple(values.items()), hidden)
        if key in self._index:
            return self._index[key]
        complex_key = (*key, atlas or "", self._user(item, atlas, depends.located))
        if complex_key in self._index:
            return self._index[complex_key]
        number = len(self._materials)
        try:
            entry = read_material(material, self._notes, self._cache, values, depends, self._glass)
            self._index[key] = number
        except ComplexError as error:
            assert material is not None
            bumps = surface_bumps(material, self._cache)
            entry = Material(material.name, np.full(3, 0.8, np.float32), np.zeros(3, np.float32))
            self._index[complex_key] = number
            self._complex[number] = _Unevaluated(material.session_uid, values, bumps, error.node)
        self._append(entry, material, hidden)
        self._surface_notes.add(material)
        return number

    def _append(self, entry: Material, material: bpy.types.Material | None, hidden: Hidden) -> None:
        """Append a material, and store which rays pass it."""
        if material is not None and not material.use_transparent_shadow:
            refracts = self._glass and has_refraction(material.node_tree)
            self._blocking |= set() if refracts else {len(self._materials)}
        self._hidden[len(self._materials)] = hidden
        self._materials.append(entry)

    def index_of_strands(self, material: bpy.types.Material | None, item: SceneItem) -> int:
        """Return the index in `Scene.materials` of the material of an object's hair, which has no textures.

        Raises PixelsNeededError if an image must be read first.
        """
        hidden = hidden_from(item)
        key = ("strands", None if material is None else material.session_uid, hidden)
        if key not in self._index:
            entry = self._strand_material(material, item)
            self._index[key] = len(self._materials)
            self._append(entry, material, hidden)
        return self._index[key]

    def _strand_material(self, material: bpy.types.Material | None, item: SceneItem) -> Material:
        """Return a hair material; the viewport color if it cannot be read or contains hair closures."""
        depends = self._depends(material)
        values = object_values(depends.sources, item)
        try:
            if material is not None and any(map(is_hair, used_nodes(node_tree(material)))):
                raise ComplexError
            entry = read_material(material, self._notes, self._cache, values, depends, self._glass)
        except ComplexError:
            assert material is not None
            self._hair_materials.append(material.name)
            color = np.array(material.diffuse_color[:3], np.float32)
            return Material(material.name, color, np.zeros(3, np.float32))
        return without_textures(entry)

    def _user(self, item: SceneItem, atlas: str | None, located: bool) -> tuple:
        """Return a key that differs for objects that need textures of their own for an evaluated material.

        Objects or instances that share a mesh have overlapping UVs, so each such mesh gets its own texture.
        Each user gets its own one if the material depends on its place. Occluders have no lightmap UVs and
        use a mean, so the key is empty.
        """
        source = item.source
        if atlas is None or (
            item.instancer is None and uv_source(source, self._uv_layer) not in self._several
        ):
            return ()
        if not located:
            return (source.data.session_uid, lightmap_layer(source, self._uv_layer))
        instancer = None if item.instancer is None else item.instancer.session_uid
        return (source.session_uid, instancer, item.persistent_id)

    def _depends(self, material: bpy.types.Material | None) -> Dependence:
        """Return the properties of an object that a material depends on; cached."""
        if material is None:
            return Dependence()
        if material.session_uid not in self._dependence:
            self._dependence[material.session_uid] = dependence(node_tree(material))
        return self._dependence[material.session_uid]

    def uv_maps(self, indices: Iterable[int]) -> set[str]:
        """Return the UV maps that the textures of materials use; "" is the one active for rendering."""
        maps: set[str] = set()
        for index in set(indices):
            material = self._materials[index]
            maps |= {texture.uv_map for texture in textures_of(material)}
            if index in self._complex:
                maps.add(LIGHTMAP_UVS)
        return maps

    def keep(self, item: ItemKey, indices: Sequence[int]) -> None:
        """Record the materials in the slots of an object if Cycles must evaluate one of them."""
        if any(index in self._complex for index in indices):
            self._wearers[item] = tuple(indices)

    @property
    def evaluations(self) -> int:
        """Number of materials that Cycles must evaluate."""
        return len(self._complex)

    def finish(self, resolution: int, moves: Mapping[int, Move]) -> Slices[tuple[Material, ...]]:
        """Evaluate the remaining materials by Cycles, and return all materials.

        resolution:  width of the lightmaps, texels
        moves:       transform from an object's lightmap UVs to its place in the atlas, by the object's
                     session uid
        """
        self._moves = moves
        failed: dict[tuple[str, str], list[str]] = {}
        variants = Counter(self._materials[index].name for index in self._complex)
        for done, index in enumerate(self._complex):
            name = self._materials[index].name
            if not any(index in slots for slots in self._wearers.values()):  # only objects without faces
                continue
            try:
                size = texture_size(resolution, variants[name])
                self._materials[index] = yield from self._evaluate(index, name, size)
            except RuntimeError as error:
                reason = str(error).strip().splitlines()[-1]
                failed.setdefault((self._complex[index].node, reason), []).append(name)
                self._materials[index] = yield from self._mean_color(index)
            yield (done + 1) / len(self._complex)
        for (node, reason), names in failed.items():
            sentence = (
                f"Materials {{}}: Cycles could not evaluate node '{node}' ({reason}). Mean colors are baked. "
                "Replace the node, or bake it into an image."
            )
            self._notes.append(listing(sentence, _once(names)))
        for attribute, materials in self._lost.items():
            sentence = f"Attribute '{attribute}' of instances cannot be read: 0 is baked in materials {{}}."
            self._notes.append(listing(sentence, list(materials)))
        if self._hair_materials:
            sentence = "Only Cycles can evaluate materials {} of hair: their viewport color is baked."
            self._notes.append(listing(sentence, _once(self._hair_materials)))
        if self._averaged:
            sentence = "Materials {} are baked with their mean color: their objects have no lightmap UVs."
            self._notes.append(listing(sentence, _once(self._averaged)))
        self._notes += self._surface_notes.sentences()
        self._note_blocking()
        for number in self._blocking:
            self._materials[number] = block_shadow_rays(self._materials[number])
        return tuple(
            hide_from_rays(material, *self._hidden[number]) for number, material in enumerate(self._materials)
        )

    def _note_blocking(self) -> None:
        """Append a note on materials that block light objects, but pass light that Cycles samples, too."""
        entries = [self._materials[number] for number in sorted(self._blocking)]
        names = [entry.name for entry in entries if entry.transmission.bounce.passes]
        glows = any(material.emission.any() for material in self._materials)
        if names and (glows or _has_texture(self._watch.context.world)):
            self._notes.append(listing(_BLOCKING, _once(names)))

    def _evaluate(self, index: int, name: str, size: int) -> Slices[Material]:
        """Evaluate a material to textures over lightmap UVs, or to mean values without lightmap UVs."""
        announcement = f"Reading material '{name}' with Cycles"
        yield announcement
        values = self._complex[index].values.items()
        with self._worn(index) as (material, shapes):
            depends = dependence(material.node_tree)
            passes = passes_of(material, depends, self._glass)
            fresnel = glass_fresnel(material.node_tree) if self._glass else None
            digest = evaluation_digest(material, shapes, values, size, self._glass)
        pixels = kept_evaluations.get(digest)
        if pixels is None:
            pixels = Pixels()
            for each in passes:
                yield announcement
                with self._worn(index) as (material, shapes):
                    image, covered = bake_pass(each, material, shapes, size, self._watch.context, self._glass)
                pixels[each], pixels[COVERED] = image, covered
            known = len(self._notes)
            self._note_values(index, name, pixels)
            yield from finish_passes(pixels)
            if len(self._notes) == known:
                kept_evaluations.keep(digest, pixels)
        is_mapped = index not in self._unmapped
        if not is_mapped:
            self._averaged.append(name)
        bumps = self._complex[index].bumps
        return EvaluatedMaterial(name, pixels, bumps, depends.by_side, is_mapped, fresnel).material()

    def _note_values(self, index: int, name: str, pixels: Pixels) -> None:
        """Append notes on invalid values; evaluations with notes are not cached: later bakes need them."""
        note_pixels(name, pixels, self._notes)
        if not all(np.isfinite(image).all() for image in pixels.values()):
            self._notes.append(INVALID_VALUES.format(name))
        material = find(bpy.data.materials, self._complex[index].uid)
        assert material is not None
        self._notes += invalid_images(material, self._checked_images)

    def _mean_color(self, index: int) -> Slices[Material]:
        """Return a texture-free replacement for a material that Cycles failed to evaluate."""
        while True:
            self._watch.depsgraph()
            material = find(bpy.data.materials, self._complex[index].uid)
            try:
                return mean_color(material, self._notes, self._cache, self._glass)
            except PixelsNeededError as unread:
                yield from unread.reading

    @contextmanager
    def _worn(self, index: int) -> Iterator[tuple[bpy.types.Material, list[EvaluatedMesh]]]:
        """Yield a material with an object's values and copies of the meshes that use it.

        The copies are removed afterwards. The meshes are those with lightmap UVs. If there are none, all
        meshes are used with a default UV map.
        """
        self._watch.depsgraph()
        unevaluated = self._complex[index]
        material = find(bpy.data.materials, unevaluated.uid)
        assert material is not None
        frozen = FrozenCopy(material, unevaluated.values) if unevaluated.values else None
        worn = material if frozen is None else frozen.copy
        shapes: list[EvaluatedMesh] = []
        try:
            wearing = self._wearing(index)
            is_deformed = wearing is None or any(map(_may_deform, wearing))
            rest = self._rest_positions() if is_deformed and uses_generated(worn.node_tree) else {}
            self._watch.evaluate(
                lambda evaluation: self._copy_users(index, worn, evaluation, shapes, rest), wearing
            )
            mapped = [
                shape
                for shape in shapes
                if add_lightmap_uv_map(shape.mesh, shape.uv_layer, self._moves.get(shape.source))
            ]
            if not mapped:
                self._unmapped.add(index)
                for shape in shapes:
                    shape.mesh.uv_layers.new(name=LIGHTMAP_UVS)
            yield worn, mapped or shapes
        finally:
            remove_shapes(shapes)
            if frozen is not None:
                frozen.remove()
            self._watch.accept()

    def _wearing(self, index: int) -> list[bpy.types.Object] | None:
        """Return the objects that use a material; None if instances use it."""
        items = [item for item, slots in self._wearers.items() if index in slots]
        if any(instancer is not None for _, instancer, _ in items):
            return None
        return find_all(bpy.data.objects, [source for source, _, _ in items])

    def _rest_positions(self) -> Mapping[ItemKey, np.ndarray | None]:
        """Return positions before deformation by object or instance, for all materials that need them.

        They are read once, since only the dependency graph of a render has them, and Blender then evaluates
        the whole view layer.
        """
        if self._rest is None:
            materials = find_all(bpy.data.materials, [each.uid for each in self._complex.values()])
            uids = {each.session_uid for each in materials if uses_generated(each.node_tree)}
            indices = {index for index, each in self._complex.items() if each.uid in uids}
            self._rest = self._watch.evaluate(
                lambda evaluation: self._read_rest(indices, evaluation), render=True
            )
        return self._rest

    def _read_rest(self, indices: set[int], evaluation: Evaluation) -> dict[ItemKey, np.ndarray | None]:
        """Read positions before deformation of all objects and instances that use some materials."""
        meshes: dict[int, np.ndarray | None] = {}
        found: dict[ItemKey, np.ndarray | None] = {}
        # With Meshes: Viewport, the bake reads other meshes, but only those of renders have these positions.
        for item in Evaluation(evaluation.depsgraph).items(self._watch.visible):
            if not indices.isdisjoint(self._wearers.get(item.key, ())):
                address = item.object.data.as_pointer()
                if address not in meshes:
                    meshes[address] = rest_positions(item.object.data)
                found[item.key] = meshes[address]
        return found

    def _copy_users(
        self,
        index: int,
        worn: bpy.types.Material,
        evaluation: Evaluation,
        shapes: list[EvaluatedMesh],
        rest: Mapping[ItemKey, np.ndarray | None],
    ) -> None:
        """Append mesh copies of all objects that use a material.

        worn:  material that replaces it on the copies
        rest:  positions before deformation, see `rest_positions`
        """
        for item in evaluation.items(self._watch.visible):
            slots = self._wearers.get(item.key, ())
            if index in slots:
                wearing = [worn if slot == index else None for slot in slots]
                layer, depsgraph = lightmap_layer(item.source, self._uv_layer), evaluation.depsgraph_of(item)
                shapes.append(
                    copy_shape(item.object, layer, item.matrix, depsgraph, wearing, rest.get(item.key))
                )


def _has_texture(world: bpy.types.World | None) -> bool:
    """Return True if a world has a texture, so that Cycles samples its light."""
    tree = None if world is None else node_tree(world)
    kinds = {node.bl_idname for node in used_nodes(tree)} - {"ShaderNodeTexCoord"}
    return any(kind.startswith("ShaderNodeTex") for kind in kinds)


def _may_deform(obj: bpy.types.Object) -> bool:
    """Return True if something may move the vertices of an object's mesh."""
    return bool(obj.modifiers) or getattr(obj.data, "shape_keys", None) is not None


def _once(names: Sequence[str]) -> list[str]:
    """Return the names in order without duplicates."""
    return list(dict.fromkeys(names))
