"""All user data of the open .blend as nested dictionaries that can be compared."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

#: Collections of datablocks that are looked at.
_KINDS = (
    "objects", "meshes", "materials", "images", "lights", "worlds", "scenes", "cameras", "collections",
    "node_groups", "curves", "metaballs", "texts", "textures", "actions", "libraries", "workspaces",
    "brushes",
)  # fmt: skip

#: Properties that Blender or a bake's own results change; dimensions are those of what modifiers make, which
#: Blender subdivides when it is first needed; an undo step sets the object that particle editing works on.
_PASSING = {
    "dimensions", "particle_edit",
    "tag", "rna_type", "is_evaluated", "is_dirty", "select_set", "asset_data", "animation_data", "preview",
    "evaluated_depsgraph", "id_data", "uv_layer_clone", "uv_layer_clone_index", "uv_layer_stencil",
    "uv_layer_stencil_index",
}  # fmt: skip

#: What a bake, and the check before it, write on scenes and objects.
_RESULTS = {
    "report", "findings", "lightmaps", "image", "uv_layer", "uv_scale", "uv_offset", "instances",
    "baked_uvs", "fingerprint", "slots", "slot_added", "baked_scene",
}  # fmt: skip

#: Results that only a finished bake or unwrap writes: a cancelled one leaves them as they were.
_FINISHED = {"bake_id", "scene_id", "automatic_width", "lightmap_side"}

#: Name of the modifiers that keep lightmap UVs, and of what they use.
_UVS = "Lightmap UVs"

#: Scenes have settings in groups of groups.
_DEPTH = 2


def fingerprint() -> dict[str, Any]:
    """Return everything of the open .blend; call it twice and compare."""
    bpy.context.view_layer.update()
    facts: dict[str, Any] = {
        "mode": bpy.context.mode,
        "scene": bpy.context.scene.name,
        "active": bpy.context.object and bpy.context.object.name,
        "selected": sorted(obj.name for obj in bpy.context.selected_objects),
        "file": bpy.data.filepath,
    }
    for kind in _KINDS:
        facts[kind] = {item.name_full: _datablock(item) for item in getattr(bpy.data, kind)}
    return facts


def differences(before: Any, after: Any, path: str = "") -> Iterator[str]:
    """Yield what is not the same, one line each."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in [*before, *(key for key in after if key not in before)]:
            inner = f"{path}/{key}"
            if key not in after:
                yield f"{inner} is gone"
            elif key not in before:
                yield f"{inner} is new"
            else:
                yield from differences(before[key], after[key], inner)
    elif not _same(before, after):
        yield f"{path}: {str(before)[:200]} became {str(after)[:200]}"


def without_results(facts: dict[str, Any], uv_layer: str, moved: set[str]) -> dict[str, Any]:
    """Return a fingerprint without what a bake makes: lightmap images, and UVs in layers or by modifiers.

    moved:  objects that have got lightmap UVs: they may get an atlas of their own, and know which UVs we made
    """
    users = {
        kind: {name: item for name, item in facts[kind].items() if not _is_made(name, item)}
        for kind in ("images", "meshes", "objects", "node_groups")
    }
    meshes = {name: _without_layer(mesh, uv_layer) for name, mesh in users["meshes"].items()}
    objects = {name: _without_uvs(obj, name in moved) for name, obj in users["objects"].items()}
    scenes = {name: _without_finished(scene) for name, scene in facts["scenes"].items()}
    return {**facts, **users, "meshes": meshes, "objects": objects, "scenes": scenes}


def unwrapped(before: dict[str, Any], after: dict[str, Any], uv_layer: str) -> set[str]:
    """Return the names of the objects that have got lightmap UVs, in a layer or by a modifier.

    A bake also moves the charts of layers that Hemibake made, if others need their place.
    """
    bare = {name for name, mesh in before["meshes"].items() if uv_layer not in mesh["uv_layers"]}
    made = {name for name, obj in before["objects"].items() if obj["hemibake"]["generated_uvs"]}
    return {
        name
        for name, obj in after["objects"].items()
        if name in made
        or obj.get("data", ("", ""))[1] in bare
        or any(item.startswith(_UVS) for item in obj["modifiers"])
    }


def _is_made(name: str, item: dict[str, Any]) -> bool:
    """Return whether a bake made a datablock."""
    marks = {"hemibake_atlas", "hemibake_uv_layer"}
    return name.startswith(f".{_UVS} of ") or not marks.isdisjoint(item["custom"])


def _without_uvs(obj: dict[str, Any], moved: bool) -> dict[str, Any]:
    modifiers = {name: item for name, item in obj["modifiers"].items() if not name.startswith(_UVS)}
    placed = {"atlas": None, "generated_uvs": None} if moved else {}
    own = _without_finished(obj)
    return {**own, "modifiers": modifiers, "hemibake": {**own["hemibake"], **placed}}


def _without_finished(item: dict[str, Any]) -> dict[str, Any]:
    """Return an object or scene without what a finished bake records of it."""
    own = {name: value for name, value in item["hemibake"].items() if name not in _FINISHED}
    return {**item, "hemibake": own}


def _without_layer(mesh: dict[str, Any], uv_layer: str) -> dict[str, Any]:
    layers = {name: layer for name, layer in mesh["uv_layers"].items() if name != uv_layer}
    # Blender keeps what is pinned and selected in attributes of its own.
    own = {uv_layer, *(f".{prefix}.{uv_layer}" for prefix in ("pn", "vs", "es"))}
    attributes = [name for name in mesh["attributes"] if name not in own]
    active = mesh["active_uv_layer"] if layers else None
    return {**mesh, "uv_layers": layers, "attributes": attributes, "active_uv_layer": active}


def _same(before: Any, after: Any) -> bool:
    return before == after or (before != before and after != after)


def _datablock(item: bpy.types.ID) -> dict[str, Any]:
    facts = _properties(item, _DEPTH if isinstance(item, bpy.types.Scene) else 1)
    facts["custom"] = {key: str(value) for key, value in item.items() if key != "hemibake"}
    tree = getattr(item, "node_tree", None) if not isinstance(item, bpy.types.Scene) else None
    if isinstance(item, bpy.types.NodeTree):
        tree = item
    if tree is not None:
        facts["nodes"] = _nodes(tree)
    extra = _EXTRA.get(type(item))
    return {**facts, **(extra(item) if extra else {})}


def _properties(struct: bpy.types.bpy_struct, depth: int) -> dict[str, Any]:
    """Return the simple properties of a struct, and of those it contains down to a depth."""
    facts = {}
    for prop in struct.bl_rna.properties:
        name = prop.identifier
        if name in _PASSING or (name in _RESULTS and "Hemibake" in type(struct).__name__):
            continue
        if prop.type == "COLLECTION":
            continue
        try:
            value = getattr(struct, name)
        except (AttributeError, RuntimeError, TypeError, ValueError):
            continue
        if prop.type == "POINTER":
            if isinstance(value, bpy.types.ID):
                facts[name] = (type(value).__name__, value.name_full)
            elif value is not None and depth > 0:
                facts[name] = _properties(value, depth - 1)
        elif not prop.is_readonly:
            facts[name] = _plain(value)
    return facts


def _plain(value: Any) -> Any:
    if isinstance(value, set):
        return sorted(value)
    if isinstance(value, (str, bytes, int, float, bool)) or value is None:
        return value
    return (
        str([list(row) if hasattr(row, "__len__") else row for row in value])
        if hasattr(value, "__len__")
        else str(value)
    )


def _nodes(tree: bpy.types.NodeTree) -> dict[str, Any]:
    nodes = {}
    for node in tree.nodes:
        sockets = [_plain(getattr(socket, "default_value", None)) for socket in node.inputs]
        nodes[node.name] = {"kind": node.bl_idname, **_properties(node, 0), "inputs": sockets}
    links = sorted(
        (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        for link in tree.links
    )
    return {"all": nodes, "links": links}


def _digest(values: np.ndarray) -> str:
    return hashlib.sha1(np.ascontiguousarray(values).tobytes()).hexdigest()


def _read(collection: Any, name: str, width: int, dtype: type) -> str:
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, values)
    return _digest(values)


def _object(obj: bpy.types.Object) -> dict[str, Any]:
    return {
        "matrix": [list(row) for row in obj.matrix_world],
        "modifiers": {item.name: _properties(item, 0) for item in obj.modifiers},
        "slots": [(slot.link, slot.material and slot.material.name) for slot in obj.material_slots],
        "collections": sorted(collection.name for collection in obj.users_collection),
        "scenes": sorted(scene.name for scene in obj.users_scene),
    }


def _mesh(mesh: bpy.types.Mesh) -> dict[str, Any]:
    layers = {
        layer.name: (_read(layer.uv, "vector", 2, np.float32), layer.active_render)
        for layer in mesh.uv_layers
        if len(layer.uv)  # a mesh in edit mode shows none
    }
    return {
        "vertices": _read(mesh.vertices, "co", 3, np.float32),
        "loops": _read(mesh.loops, "vertex_index", 1, np.int32),
        "material_indices": _read(mesh.polygons, "material_index", 1, np.int32),
        "selected": _read(mesh.polygons, "select", 1, bool),
        "materials": [item and item.name for item in mesh.materials],
        "uv_layers": layers,
        "active_uv_layer": mesh.uv_layers.active and mesh.uv_layers.active.name,
        "attributes": sorted(item.name for item in mesh.attributes),
    }


def _image(image: bpy.types.Image) -> dict[str, Any]:
    pixels = np.empty(len(image.pixels), np.float32) if image.type == "IMAGE" else np.empty(0, np.float32)
    if len(pixels):
        image.pixels.foreach_get(pixels)
    packed = image.packed_file
    return {
        "size": tuple(image.size),
        "pixels": _digest(pixels),
        "packed": packed and packed.size,
    }


def _collection(collection: bpy.types.Collection) -> dict[str, Any]:
    return {
        "objects": [obj.name for obj in collection.objects],
        "children": [c.name for c in collection.children],
    }


def _scene(scene: bpy.types.Scene) -> dict[str, Any]:
    return {
        "root": _collection(scene.collection),
        "layers": {layer.name: _layer(layer.layer_collection) for layer in scene.view_layers},
    }


def _layer(layer: bpy.types.LayerCollection) -> dict[str, Any]:
    return {**_properties(layer, 0), "children": {child.name: _layer(child) for child in layer.children}}


def _text(text: bpy.types.Text) -> dict[str, Any]:
    return {"text": text.as_string()}


_EXTRA = {
    bpy.types.Object: _object,
    bpy.types.Mesh: _mesh,
    bpy.types.Image: _image,
    bpy.types.Collection: _collection,
    bpy.types.Scene: _scene,
    bpy.types.Text: _text,
}
