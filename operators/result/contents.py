"""Contents of the lightmaps for the manifest: atlas, output and objects of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import bpy

from ...engine.outputs import DECODING
from ...engine.postprocess.output_names import output_names
from ...engine.settings import Settings
from ..lookup import find_all
from ..scene import ReadScene
from ..scene.bake_records import Record, bake_record
from ..scene.uv_transform import UvTransform
from ..scene.uvs.lightmap_layer import lightmap_layer
from .file_names import names_by_template
from .level_maps import LEVEL_UVS
from .preserved_texels import PreservedTexels


def lightmap_contents(
    scene: bpy.types.Scene,
    read: ReadScene,
    settings: Settings,
    uv_layer: str,
    kept: PreservedTexels,
    levels: Mapping[int, int],
) -> list[dict]:
    """Return "atlas", "output" and "objects" of each lightmap, all atlases of each output in turn.

    levels:  session uid of the first level, by the session uid of each level of detail
    """
    objects = _objects_by_atlas(read, uv_layer)
    places = {entry.uid: entry.place for entry in read.objects}
    for obj in find_all(bpy.data.objects, levels):
        place = places[levels[obj.session_uid]]
        entry = {"uv_layer": LEVEL_UVS, "scale": float(place.scale), "offset": list(map(float, place.offset))}
        objects.setdefault(place.atlas, []).append({**named(obj), **entry})
    for atlas, obj in kept.objects():
        objects.setdefault(atlas, []).append({**named(obj), **_as_before(bake_record(obj, scene))})
    return [
        {"atlas": atlas, "output": output, **decoding(output), "objects": objects.get(atlas, [])}
        for output in output_names(read.scene, settings)
        for atlas in read.scene.atlases
    ]


def decoding(output: str) -> dict[str, str]:
    """Return the decoding formula of a directional map, JSON-ready; empty for other outputs."""
    return {"decode": DECODING[output]} if output in DECODING else {}


def named(obj: bpy.types.Object) -> dict[str, str]:
    """Return the identity of an object, JSON-ready: its name, and its library if linked.

    A local and a linked object may have the same name.
    """
    library = {} if obj.library is None else {"library": obj.library.filepath}
    return {"object": obj.name, **library}


def chosen_names(
    template: str,
    scene: bpy.types.Scene,
    atlases: Sequence[str],
    outputs: Sequence[str],
    resolution: int,
    blend: str,
) -> list[str]:
    """Return the names that a user's template gives to the lightmaps of a .blend, in order.

    Raises SettingsError, see `names_by_template`. Returns an empty list without a template.
    """
    known = {
        "file": Path(blend).stem or "untitled",
        "scene": scene.name,
        "format": scene.hemibake.file_format,
        "resolution": str(resolution),
    }
    images = [{**known, "lightmap": atlas, "output": output} for output in outputs for atlas in atlases]
    return names_by_template(template.strip(), images) if template.strip() else []


def _objects_by_atlas(read: ReadScene, uv_layer: str) -> dict[str, list[dict]]:
    """Return the objects and instances in each atlas; lightmap UV = UV of the mesh * scale + offset."""
    found: dict[str, list[dict]] = {}
    uids = [entry.uid for entry in read.entries if entry is not None]
    present = {obj.session_uid: obj for obj in find_all(bpy.data.objects, uids)}
    for uid, place in read.objects:
        obj = present.get(uid)
        if obj is not None:
            found.setdefault(place.atlas, []).append({**named(obj), **_placed(place, obj, uv_layer)})
    for uid, name, number, place in read.instances:
        instancer = present.get(uid)
        if instancer is not None:
            same = [obj for obj in bpy.data.objects if obj.name == name]
            shown = same[0] if same else instancer
            known = named(shown) if len(same) == 1 else {"object": name}
            entry = {**known, "instancer": instancer.name, "persistent_id": number}
            found.setdefault(place.atlas, []).append({**entry, **_placed(place, shown, uv_layer)})
    return found


def _as_before(known: Record) -> dict:
    """Return the UV transform of an object's last bake as JSON-ready entries."""
    return {
        "uv_layer": known.uv_layer,
        "scale": float(known.uv_scale),
        "offset": [float(x) for x in known.uv_offset],
    }


def _placed(place: UvTransform, obj: bpy.types.Object, uv_layer: str) -> dict:
    """Return the UV layer and UV transform of an object in its atlas as JSON-ready entries."""
    return {
        "uv_layer": lightmap_layer(obj, uv_layer),
        "scale": float(place.scale),
        "offset": [float(x) for x in place.offset],
    }
