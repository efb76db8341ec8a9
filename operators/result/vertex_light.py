"""Light as colors of meshes: fits the lightmaps of objects with *Bake To: Vertices* to their vertices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

import bpy
import numpy as np

from ...engine.errors import EngineError
from ...engine.object_message import object_message
from ...engine.vertex_light.vertex_fit import VertexLight, corner_values, fit_vertices
from ..lookup import find_all
from ..scene import ReadScene, SceneContext
from ..scene.bake_records import Record, writable_record
from ..scene.objects.evaluation import Evaluation, evaluate
from ..scene.objects.meshes import MeshArrays, read_mesh
from ..scene.uvs.lightmap_layer import lightmap_layer
from ..scene.uvs.multi_user import multi_user_sources
from ..scene.uvs.uv_targets import evaluated_mesh
from ..working_space import from_rec709

#: Name of the color attribute. It differs from Lightmap, the default name of the UV layer, because two
#: attributes of a mesh cannot have the same name.
COLORS = "Lightmap Color"

#: Error, as a fraction of the mean light, above which a warning names the object (chosen).
_COARSE = 0.25

_OTHERWISE = "or set Bake To to Lightmap"
SHARED = (
    "{}: several objects or instances share the mesh, whose colors can hold the light of only one. The "
    f"lightmap is used instead. Use Object > Relations > Make Single User > Object & Data, {_OTHERWISE}."
)
LINKED = (
    "{}: the mesh is linked from another file, so it cannot get colors. The lightmap is used instead. Make "
    f"the mesh local, {_OTHERWISE}."
)
EDITED = (
    "{}: the mesh is in Edit Mode, so it cannot get colors. The lightmap is used instead. Leave Edit Mode "
    "and bake again."
)
MODIFIED = (
    "{}: modifiers change the faces, so colors of the mesh do not fit. The lightmap is used instead. Apply "
    f"the modifiers, {_OTHERWISE}."
)
NAMED = (
    f"{{}}: an attribute called '{COLORS}' is not a color attribute. The lightmap is used instead. Rename it."
)
_TOO_COARSE = (
    f"{{}}: light at the vertices differs from the lightmap by more than {_COARSE:.0%} of the mean (RMS). "
    f"Subdivide the mesh, {_OTHERWISE}."
)


def store_vertex_light(
    context: SceneContext, read: ReadScene, lightmaps: Mapping[str, np.ndarray], lost: Mapping[int, str]
) -> tuple[list[dict], list[str]]:
    """Write the light of baked objects to their vertices, or remove old colors of objects with lightmaps.

    Returns the report's entry of each object with such light, and notes on objects that keep their lightmap.
    If Blender cannot evaluate the scene, all keep it, and a note has the reason. Call this after
    `mark_objects`.

    lightmaps:  (h, w, 3) float32, linear Rec.709, by atlas
    lost:       session uids and names of objects without lightmap UVs, which stay unchanged
    """
    scene, places = context.scene, {entry.uid: entry.place for entry in read.objects}
    baked = [obj for obj in find_all(bpy.data.objects, places.keys() - lost.keys()) if obj.is_editable]
    wanted = [obj for obj in baked if obj.hemibake.bake_to == "VERTICES"]
    meshes, notes = dict[int, MeshArrays | str](), list[str]()
    try:
        if wanted:
            meshes = read_vertex_meshes(context, wanted, {entry.name for entry in read.instances})
    except EngineError as error:
        notes.append(str(error))
    fitted, issues = dict[str, VertexLight](), dict[str, list[str]]()
    for obj in baked:
        record, mesh, light = writable_record(obj, scene), meshes.get(obj.session_uid), None
        if isinstance(mesh, str):
            issues.setdefault(mesh, []).append(obj.name)
        elif mesh is not None and mesh.uvs is not None:
            place = places[obj.session_uid]
            light = _store(obj, mesh, place.apply(mesh.uvs), lightmaps[place.atlas])
            fitted[obj.name] = light
        if record.on_vertices and light is None:
            _remove_colors(obj)
        record.on_vertices = light is not None
    coarse = [name for name, light in fitted.items() if light.error > _COARSE]
    if coarse:
        issues[_TOO_COARSE] = coarse
    entries = [
        {"object": name, "values": len(light.light), "error": light.error}
        for name, light in sorted(fitted.items())
    ]
    notes += [object_message(sentence, sorted(names)) for sentence, names in issues.items()]
    return entries, notes


def read_vertex_meshes(
    context: SceneContext, objects: Sequence[bpy.types.Object], instanced: Set[str] = frozenset()
) -> dict[int, MeshArrays | str]:
    """Return the evaluated mesh of each object, by session uid, or the reason why it cannot hold light.

    instanced:  names of objects that have instances with lightmaps
    """
    uv_layer = context.scene.hemibake.uv_layer
    several = multi_user_sources(uv_layer)

    def read(evaluation: Evaluation) -> dict[int, MeshArrays | str]:
        found: dict[int, MeshArrays | str] = {}
        for obj in objects:
            is_shared = obj.name in instanced or obj.data.session_uid in several
            issue = SHARED if is_shared else _issue(obj.data)
            layer = lightmap_layer(obj, uv_layer)
            found[obj.session_uid] = issue or _read(obj, layer, evaluation)
        return found

    return evaluate(context, read, objects)


def _issue(mesh: bpy.types.Mesh) -> str:
    """Return the sentence on why a mesh cannot get colors; empty if it can."""
    if not mesh.is_editable:
        return LINKED
    if mesh.is_editmode:
        return EDITED
    return NAMED if COLORS in mesh.attributes and COLORS not in mesh.color_attributes else ""


def _read(obj: bpy.types.Object, layer: str, evaluation: Evaluation) -> MeshArrays | str:
    """Return the evaluated mesh of an object with the UVs of a layer; a sentence if its faces differ."""
    with evaluated_mesh(obj, evaluation) as mesh:
        if mesh is None or len(mesh.loops) != len(obj.data.loops):
            return MODIFIED
        arrays, own = read_mesh(mesh, layer, {}), read_mesh(obj.data, None, {})
    same = np.array_equal(arrays.corners, own.corners) and np.array_equal(arrays.sizes, own.sizes)
    return arrays if same else MODIFIED


def shows_vertices(obj: bpy.types.Object, record: Record) -> bool:
    """Return True if the mesh of an object holds the light of a bake."""
    return bool(record.on_vertices) and COLORS in obj.data.color_attributes


def _store(obj: bpy.types.Object, mesh: MeshArrays, uvs: np.ndarray, lightmap: np.ndarray) -> VertexLight:
    """Fit a lightmap to the vertices of an object, and store the light in its mesh.

    uvs:  (l, 2) float32, lightmap UVs of corners
    """
    values = corner_values(mesh.corners, mesh.normals)
    points = mesh.positions[mesh.corners[mesh.loops]].astype(np.float64)
    sides = (points[:, 1:] - points[:, :1]) @ np.array(obj.matrix_world, np.float64)[:3, :3].T
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    count = int(values.max(initial=-1)) + 1
    light = fit_vertices(lightmap, uvs[mesh.loops], areas, values[mesh.loops], count)
    colors = np.ones((len(values), 4), np.float32)
    colors[:, :3] = from_rec709(light.light)[values]
    _write_colors(obj.data, colors)
    return light


def _write_colors(mesh: bpy.types.Mesh, colors: np.ndarray) -> None:
    """Write colors of corners, (l, 4) float32, scene-linear; the active color attributes stay as they are."""
    attributes = mesh.color_attributes
    attribute = attributes.get(COLORS)
    if attribute is not None and (attribute.data_type, attribute.domain) != ("FLOAT_COLOR", "CORNER"):
        attributes.remove(attribute)
        attribute = None
    if attribute is None:
        active, shown = attributes.active_color_name, attributes.default_color_name
        attribute = attributes.new(COLORS, "FLOAT_COLOR", "CORNER")
        if active:
            attributes.active_color_name = active
        if shown:
            attributes.default_color_name = shown
    mesh.color_attributes[COLORS].data.foreach_set("color", colors.reshape(-1))
    mesh.update()


def _remove_colors(obj: bpy.types.Object) -> None:
    """Remove the light of an earlier bake from the mesh of an object."""
    mesh = obj.data
    if mesh.is_editable and not mesh.is_editmode and COLORS in mesh.color_attributes:
        mesh.color_attributes.remove(mesh.color_attributes[COLORS])
