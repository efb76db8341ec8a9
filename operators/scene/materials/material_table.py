"""The materials of a bake: each read once, and those that only Blender can evaluate baked by it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import bpy
import numpy as np

from ....engine.naming import listing
from ....engine.scene.model import Material, Texture
from ...compat import node_tree
from ..objects.items import SceneItem
from ..objects.meshes import LIGHTMAP_UVS
from ..uvs.lightmap_layer import lightmap_layer
from ..uvs.uv_modifier import uv_source
from .materials import read_material
from .object_nodes import Dependence, FrozenMaterial, Source, dependence, lost_attributes, object_values
from .pixels import PixelCache
from .shader_bake import Move, Shape, bake_textures, copy_shape, lay_lightmap_uvs, remove_shapes
from .sockets import ComplexError

_ONES = np.ones(3, np.float32)


class MaterialTable:
    """Collects the materials of all objects while they are read.

    uv_layer  name of the lightmap UV layer
    several   sources of lightmap UVs that may be shown several times, see `multi_user_sources`
    notes     sentences for the user are appended here
    """

    def __init__(
        self, depsgraph: bpy.types.Depsgraph, uv_layer: str, several: set[int], notes: list[str]
    ) -> None:
        self._depsgraph, self._uv_layer = depsgraph, uv_layer
        self._several, self._notes = several, notes
        self._cache = PixelCache(notes)
        self._index: dict[tuple, int] = {}
        self._materials: list[Material] = []
        self._complex: dict[int, bpy.types.Material] = {}
        self._dependence: dict[int, Dependence] = {}
        self._frozen: list[FrozenMaterial] = []
        self._lost: dict[str, dict[str, None]] = {}
        self._shapes: list[tuple[Shape, frozenset[int]]] = []
        self._averaged: list[str] = []

    def index(self, material: bpy.types.Material | None, atlas: str | None, item: SceneItem) -> int:
        """Return the index into `Scene.materials` of a material on an item of an atlas (None: occluders)."""
        depends = self._depends(material)
        values = object_values(depends.sources, item)
        for name in lost_attributes(values, item):
            self._lost.setdefault(name, {})[material.name] = None
        key = (None if material is None else material.session_uid, tuple(values.items()))
        if key in self._index:
            return self._index[key]
        complex_key = (*key, atlas or "", self._user(item, atlas, depends.located))
        if complex_key in self._index:
            return self._index[complex_key]
        number = len(self._materials)
        try:
            entry = read_material(material, self._notes, self._cache, values)
            self._index[key] = number
        except ComplexError:
            entry = Material(material.name, np.full(3, 0.8, np.float32), np.zeros(3, np.float32))
            self._index[complex_key] = number
            self._complex[number] = self._freeze(material, values) if values else material
        self._materials.append(entry)
        return number

    def _user(self, item: SceneItem, atlas: str | None, located: bool) -> tuple:
        """Return what tells items apart that show one mesh several times, and so need textures of their own.

        The mesh's UVs may lie over those of other such meshes: each mesh has its texture, and each user if it
        matters where that is. Of occluders, without such UVs, a mean is taken.
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
        """Return how a material depends on the object that shows it."""
        if material is None:
            return Dependence()
        if material.session_uid not in self._dependence:
            self._dependence[material.session_uid] = dependence(node_tree(material))
        return self._dependence[material.session_uid]

    def _freeze(
        self, material: bpy.types.Material, values: dict[Source, tuple[float, ...]]
    ) -> bpy.types.Material:
        """Return a material as it looks on objects with these values."""
        self._frozen.append(FrozenMaterial(material, values))
        return self._frozen[-1].material

    def uv_maps(self, indices: Iterable[int]) -> set[str]:
        """Return the UV maps that textures of these materials need; "" is the one that renders use."""
        maps: set[str] = set()
        for index in set(indices):
            material = self._materials[index]
            textures = (material.reflectance_map, material.emission_map, material.alpha_map)
            maps |= {texture.uv_map for texture in textures if texture is not None}
            if index in self._complex:
                maps.add(LIGHTMAP_UVS)
        return maps

    def keep(self, item: SceneItem, indices: Sequence[int]) -> None:
        """Keep a copy of an item if Blender has to evaluate the material of one of its slots."""
        wanted = frozenset(index for index in indices if index in self._complex)
        if wanted:
            slots = [self._complex.get(index) for index in indices]
            layer = lightmap_layer(item.source, self._uv_layer)
            shape = copy_shape(item.object, layer, item.matrix, self._depsgraph, slots)
            self._shapes.append((shape, wanted))

    def discard(self) -> None:
        """Remove the copies of meshes and materials."""
        remove_shapes([shape for shape, _ in self._shapes])
        self._shapes.clear()
        for frozen in self._frozen:
            frozen.remove()
        self._frozen.clear()

    def finish(self, resolution: int, moves: Mapping[int, Move]) -> tuple[Material, ...]:
        """Evaluate what is left to Blender at a resolution, and return all materials.

        moves: of objects by session uid, how their charts get to where they are put: textures go with them
        """
        self._mapped = {
            shape.mesh.session_uid
            for shape, _ in self._shapes
            if lay_lightmap_uvs(shape.mesh, shape.uv_layer, moves.get(shape.source))
        }
        failed = []
        variants = Counter(self._materials[index].name for index in self._complex)
        for index, material in self._complex.items():
            name = self._materials[index].name
            shapes = [shape for shape, wanted in self._shapes if index in wanted]
            if not shapes:  # only objects without faces have it
                continue
            try:
                self._materials[index] = self._evaluate(name, material, shapes, (resolution, variants[name]))
            except RuntimeError as error:
                failed.append(name)
                reason = str(error).strip().splitlines()[-1]
        if failed:
            self._notes.append(
                listing(
                    f"Cycles could not evaluate the materials {{}} ({reason}): grey is baked.", _once(failed)
                )
            )
        for attribute, materials in self._lost.items():
            sentence = f"Attribute '{attribute}' of instances cannot be read: 0 is baked in materials {{}}."
            self._notes.append(listing(sentence, list(materials)))
        if self._averaged:
            sentence = "Occluders have no lightmap UVs: a mean colour stands for the materials {}."
            self._notes.append(listing(sentence, _once(self._averaged)))
        return tuple(self._materials)

    def _evaluate(
        self, name: str, material: bpy.types.Material, shapes: list[Shape], size: tuple[int, int]
    ) -> Material:
        """Return a material as textures over the lightmap UVs; as means where shapes have none.

        size: resolution and variants of the material, see `bake_textures`.
        """
        mapped = [shape for shape in shapes if shape.mesh.session_uid in self._mapped]
        chosen = mapped or shapes
        if not mapped:
            for shape in shapes:
                shape.mesh.uv_layers.new(name=LIGHTMAP_UVS)
        pixels = bake_textures(material, chosen, *size)
        entry = Material(name, _ONES, np.zeros(3, np.float32), culled=material.use_backface_culling)
        if mapped:
            return replace(entry, **self._maps(name, pixels))
        self._averaged.append(name)
        return replace(entry, **_means(pixels))

    def _maps(self, name: str, pixels: dict[str, np.ndarray]) -> dict:
        """Return the texture fields of a material."""
        maps = {
            f"{kind}_map": Texture(name, np.ascontiguousarray(values), LIGHTMAP_UVS, extension="extend")
            for kind, values in pixels.items()
            if kind != "emission" or values.any()
        }
        if "emission_map" in maps:
            maps["emission"] = _ONES
        return maps


def _once(names: Sequence[str]) -> list[str]:
    """Return names without those that came before."""
    return list(dict.fromkeys(names))


def _means(pixels: dict[str, np.ndarray]) -> dict:
    """Return the constant fields of a material: means over the texels that were baked."""
    seen = pixels["reflectance"].any(axis=2) | pixels["emission"].any(axis=2)
    chosen = seen if seen.any() else np.ones_like(seen)
    fields = {kind: pixels[kind][chosen].mean(axis=0) for kind in ("reflectance", "emission")}
    if "alpha" in pixels:
        fields["alpha"] = float(pixels["alpha"][chosen].mean())
    return fields
