"""Objects to bake, and snapshots of data that must not change."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import numpy as np

from tools.headless import MODULE


def part(name: str):
    """Return a module of the enabled extension."""
    return importlib.import_module(f"{MODULE}.{name}")


def material(name="Grey", colour=(0.5, 0.5, 0.5), emission=0.0):
    import bpy

    result = bpy.data.materials.new(name)
    tree = part("operators.compat").new_node_tree(result)
    node = tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (*colour, 1)
    node.inputs["Emission Strength"].default_value = emission
    return result


def bpy_link(obj):
    """Link an object to the scene and return it."""
    import bpy

    bpy.context.scene.collection.objects.link(obj)
    return obj


def mesh_object(name, vertices, faces, uvs=None, surface=None):
    """Return a linked object; `uvs` of all loops make a lightmap UV layer."""
    import bpy

    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    if uvs is not None:
        layer = mesh.uv_layers.new(name="Lightmap")
        layer.uv.foreach_set("vector", np.asarray(uvs, np.float32).reshape(-1))
    if surface is not None:
        mesh.materials.append(surface)
    result = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(result)
    bpy.context.view_layer.update()
    return result


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
SQUARE_UVS = [(0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9)]
CUBE = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
INWARD = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def square(name="Square", uvs=SQUARE_UVS, surface=None):
    return mesh_object(name, SQUARE, [(0, 1, 2, 3)], uvs, surface)


def furnace(name="Furnace"):
    """Return a closed cube seen from inside: reflectance 0.5, radiance 1, so E/pi is 2 everywhere."""
    return mesh_object(name, CUBE, INWARD, surface=material("Glow", emission=1.0))


def read_scene(shared=False):
    """Read the scene as the add-on does; return the result. shared: True for meshes in shared memory."""
    import bpy

    scene = part("operators.scene")
    context, resolution = scene.SceneContext(bpy.context), bpy.context.scene.hemibake.resolution
    meshes = scene.visible_meshes(context)
    return finished(scene.read_scene(context, meshes, "Lightmap", resolution, shared=shared))


def unwrap_missing(objects, resolution, changes):
    """Unwrap objects that lack lightmap UVs; return the summary."""
    import bpy

    context = part("operators.scene").SceneContext(bpy.context)
    unwrap = part("operators.scene.uvs.unwrap")
    return finished(unwrap.unwrap_missing(context, objects, "Lightmap", resolution, changes))


def finished(work):
    """Run work in slices to its end; return the result."""
    return part("engine.progress").finished(work)


def loop_uvs(obj, layer="Lightmap") -> np.ndarray:
    """Return a UV layer, (l, 2)."""
    uvs = np.empty(2 * len(obj.data.loops), np.float32)
    obj.data.uv_layers[layer].uv.foreach_get("vector", uvs)
    return uvs.reshape(-1, 2)


def shrink_charts(obj, layer="Lightmap"):
    """Make the charts of an object half as large, about the lower left corner."""
    obj.data.uv_layers[layer].uv.foreach_set("vector", np.float32(0.5) * loop_uvs(obj, layer).reshape(-1))
    obj.data.update()


def geometry_nodes(obj, *kinds):
    """Give an object a Geometry Nodes modifier; return its tree, and input, output and nodes in it."""
    import bpy

    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    nodes = [tree.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput", *kinds)]
    obj.modifiers.new("Nodes", "NODES").node_group = tree
    return tree, nodes


def evaluated_uvs(obj, layer="Lightmap") -> np.ndarray:
    """Return a UV layer of the mesh that modifiers make, (l, 2)."""
    import bpy

    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return part("operators.scene.objects.meshes").read_uvs(mesh.uv_layers[layer])


def cross(a, b) -> np.ndarray:
    """Return the cross product of vectors in the plane, (...)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def covering(triangles, size) -> np.ndarray:
    """Return the number of UV triangles, (t, 3, 2), over each texel centre of a lightmap, (size, size)."""
    centre = (np.arange(size) + 0.5) / size
    count = np.zeros((size, size), int)
    for triangle in np.asarray(triangles, np.float64):
        low, high = (np.clip(bound, 0, 1) * size for bound in (triangle.min(axis=0), triangle.max(axis=0)))
        columns, rows = (slice(int(low[axis]), int(high[axis]) + 1) for axis in (0, 1))
        points = np.stack(np.meshgrid(centre[columns], centre[rows]), axis=-1)
        sides = np.array([cross(triangle[(i + 1) % 3] - triangle[i], points - triangle[i]) for i in range(3)])
        count[rows, columns] += (sides > 1e-9).all(axis=0) | (sides < -1e-9).all(axis=0)
    return count


def pixels(image) -> np.ndarray:
    """Return an image's pixels, (h, w, 4)."""
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(*reversed(image.size), 4)


def report() -> dict:
    import bpy

    return json.loads(bpy.context.scene.hemibake.report)


def snapshot() -> dict:
    """Return everything of the file that a bake that fails must leave alone."""
    import bpy

    render = bpy.context.scene.render
    return {
        "mode": bpy.context.mode,
        "active": bpy.context.object and bpy.context.object.name,
        "selected": sorted(obj.name for obj in bpy.context.selected_objects),
        "render": (render.engine, render.filepath, render.image_settings.file_format),
        "images": {image.name: pixels(image).tobytes() for image in bpy.data.images if image.type == "IMAGE"},
        "materials": sorted(item.name for item in bpy.data.materials),
        "atlases": {obj.name: obj.hemibake.atlas for obj in bpy.data.objects},
        "modifiers": {obj.name: [modifier.name for modifier in obj.modifiers] for obj in bpy.data.objects},
        "node groups": sorted(group.name for group in bpy.data.node_groups),
        "meshes": {mesh.name: _mesh_state(mesh) for mesh in bpy.data.meshes},
        "slots": {
            obj.name: [(slot.link, slot.material and slot.material.name) for slot in obj.material_slots]
            for obj in bpy.data.objects
        },
    }


def _mesh_state(mesh) -> tuple:
    layers = [(layer.name, layer.active_render) for layer in mesh.uv_layers]
    uvs = []
    for layer in mesh.uv_layers:
        values = np.empty(2 * len(layer.uv), np.float32)
        layer.uv.foreach_get("vector", values)
        uvs.append(values.tobytes())
    slots = [polygon.material_index for polygon in mesh.polygons]
    return layers, mesh.uv_layers.active_index, uvs, slots, "material_index" in mesh.attributes


def files_below(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
