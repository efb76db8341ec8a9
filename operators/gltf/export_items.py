"""Lists the objects and instances of a glTF export, and where their lightmaps are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..object_properties import has_left_role
from ..result.instance_uv_table import baked_instances, instance_image
from ..result.vertex_light import shows_vertices
from ..scene.bake_records import bake_record
from ..scene.objects.items import SceneItem, scene_items
from ..scene.objects.visible import visible_objects
from ..scene.uvs.lightmap_layer import lightmap_layer

#: Tolerance for equal matrices, since the exporter splits them into rotation and scale.
_NOISE = 1e-5


@dataclass(frozen=True)
class GltfUvTransform:
    """Lightmap of a surface: lightmap UV = UV of the layer * scale + offset.

    image:   the lightmap
    layer:   name of the UV layer
    scale:   factor of the UVs
    offset:  offset of the scaled UVs
    """

    image: bpy.types.Image
    layer: str
    scale: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)

    def apply(self, uvs: np.ndarray) -> np.ndarray:
        """Transform UVs of the layer to lightmap UVs, (n, 2) float32."""
        return (uvs.astype(np.float64) * self.scale + np.array(self.offset)).astype(np.float32)


@dataclass(frozen=True, eq=False)
class ExportItem:
    """A mesh object, or an instance of one.

    source:         the object
    mesh:           name of its mesh
    matrix:         (4, 4) float64, object space to world space
    instancer:      name of the object that makes the instance; None for the object itself
    persistent_id:  Blender's identifier of the instance
    place:          its lightmap; None without one
    on_vertices:    True if the colors of its mesh hold its light
    """

    source: bpy.types.Object
    mesh: str
    matrix: np.ndarray
    instancer: str | None
    persistent_id: tuple[int, ...]
    place: GltfUvTransform | None
    on_vertices: bool

    @property
    def lightmap(self) -> GltfUvTransform:
        """Its lightmap, which it must have."""
        assert self.place is not None
        return self.place


class ExportItems:
    """All mesh objects and instances that are visible in both the viewport and renders."""

    def __init__(self, context: bpy.types.Context) -> None:
        self.all = list(_read(context))
        self._by_source = {key: _Group(group) for key, group in _grouped(self.all, "source").items()}
        self._by_mesh = {key: _Group(group) for key, group in _grouped(self.all, "mesh").items()}

    @property
    def images(self) -> list[bpy.types.Image]:
        """The lightmaps without duplicates."""
        return list(dict.fromkeys(surface.place.image for surface in self.all if surface.place))

    @property
    def on_vertices(self) -> bool:
        """True if the colors of a mesh hold light."""
        return any(surface.on_vertices for surface in self.all)

    def of_object(self, source: bpy.types.Object, matrix: np.ndarray) -> ExportItem | None:
        """Return the object or its instance whose world matrix is nearest to `matrix`."""
        return self._by_source[source].nearest(matrix) if source in self._by_source else None

    def of_mesh(self, mesh: str, matrix: np.ndarray) -> ExportItem | None:
        """Return the instance of a mesh, by the mesh's name, whose world matrix is nearest to `matrix`."""
        return self._by_mesh[mesh].nearest(matrix) if mesh in self._by_mesh else None


class _Group:
    """Export items with the same mesh or object, which differ only in their matrices."""

    def __init__(self, surfaces: Sequence[ExportItem]) -> None:
        self._surfaces = surfaces
        self._matrices = np.array([surface.matrix for surface in surfaces])
        self._own = np.array([surface.instancer is None for surface in surfaces])

    def nearest(self, matrix: np.ndarray) -> ExportItem:
        """Return the item whose matrix has the smallest maximum difference to `matrix`; instances win ties.

        An object that is instanced on vertices is also listed at its own place, where it is not visible.
        """
        differences = np.abs(self._matrices - matrix).max(axis=(1, 2))
        return self._surfaces[int(np.argmin(np.maximum(differences, _NOISE) + _NOISE * self._own))]


def _grouped(surfaces: Iterable[ExportItem], name: str) -> dict:
    """Return the surfaces in a dictionary by the value of an attribute."""
    groups: dict = {}
    for surface in surfaces:
        groups.setdefault(getattr(surface, name), []).append(surface)
    return groups


def _read(context: bpy.types.Context) -> Iterator[ExportItem]:
    scene, visible = context.scene, {obj.session_uid for obj in visible_objects(context)}
    baked = baked_instances(scene)
    for item in scene_items(context.evaluated_depsgraph_get(), visible):
        if item.source.type == "MESH":
            entry = baked.get((item.instancer, item.source.name, item.persistent_id))
            instancer = None if item.instancer is None else item.instancer.name
            on_vertices = instancer is None and _is_on_vertices(item.source, scene)
            place = _own_place(item.source, scene) if instancer is None else _place(item, entry, scene)
            mesh, number = item.object.data.name, item.persistent_id
            place = None if on_vertices else place
            yield ExportItem(
                source=item.source,
                mesh=mesh,
                matrix=item.matrix,
                instancer=instancer,
                persistent_id=number,
                place=place,
                on_vertices=on_vertices,
            )


def _is_on_vertices(obj: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    return not has_left_role(obj) and shows_vertices(obj, bake_record(obj, scene))


def _own_place(obj: bpy.types.Object, scene: bpy.types.Scene) -> GltfUvTransform | None:
    known = bake_record(obj, scene)
    if known.image is None or has_left_role(obj):
        return None
    return GltfUvTransform(known.image, known.uv_layer, known.uv_scale, tuple(known.uv_offset))


def _place(item: SceneItem, entry: dict | None, scene: bpy.types.Scene) -> GltfUvTransform | None:
    """Return the lightmap of an instance as recorded by the last bake; None without one."""
    image = None if entry is None else instance_image(scene, entry)
    if (
        entry is None
        or image is None
        or has_left_role(item.source)
        or (item.instancer and has_left_role(item.instancer))
    ):
        return None
    layer = bake_record(item.source, scene).uv_layer or lightmap_layer(item.source, scene.hemibake.uv_layer)
    return GltfUvTransform(image, layer, entry["scale"], tuple(entry["offset"]))
