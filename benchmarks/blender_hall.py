"""The hall as a Blender scene, for comparisons with Cycles."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from benchmarks.halls import TRIANGLES, hall
from engine import Light, Mesh, Scene
from tools.verification.scenes import material


def build_hall(resolution: int, triangles: int = TRIANGLES) -> None:
    """Add `hall` with its lightmap UVs, its lamps and its sky to the open file.

    resolution: width of its lightmap, texels
    """
    scene = hall(resolution, triangles)
    (mesh,) = scene.meshes
    collection = bpy.context.scene.collection
    collection.objects.link(_object(mesh, scene))
    for light in scene.lights:
        collection.objects.link(_lamp(light))
    bpy.context.scene.world = _world(scene.world)


def _object(mesh: Mesh, scene: Scene) -> bpy.types.Object:
    """Return an object with a mesh of an engine's scene; triangles share corners that lie together."""
    corners = mesh.positions.reshape(-1, 3).astype(np.float32)
    vertices, indices = np.unique(corners, axis=0, return_inverse=True)
    data = bpy.data.meshes.new(mesh.name)
    data.from_pydata(vertices, (), indices.reshape(-1, 3))
    layer = data.uv_layers.new(name="Lightmap")
    layer.uv.foreach_set("vector", mesh.uvs.reshape(-1).astype(np.float32))
    for surface in scene.materials:
        data.materials.append(material(surface.name, surface.reflectance))
    data.polygons.foreach_set("material_index", np.asarray(mesh.material, np.int32))
    return bpy.data.objects.new(mesh.name, data)


def _lamp(light: Light) -> bpy.types.Object:
    """Return a sun, or a point light of the same radiant intensity, W/sr: Blender has its flux, W."""
    data = bpy.data.lights.new(light.name, light.kind.upper())
    brightest = float(light.strength.max())
    data.color = light.strength / brightest
    if light.kind == "sun":
        data.energy, data.angle = brightest, 2 * light.half_angle
    else:
        data.energy, data.shadow_soft_size = 4 * np.pi * brightest, light.radius
    lamp = bpy.data.objects.new(light.name, data)
    lamp.matrix_world = Matrix.LocRotScale(light.position, Matrix(light.axes.T).to_quaternion(), None)
    return lamp


def _world(sky: np.ndarray) -> bpy.types.World:
    """Return a world of an equirectangular map, (h, w, 3) float32."""
    height, width, _ = sky.shape
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    image.pixels.foreach_set(np.dstack([sky, np.ones((height, width), np.float32)]).ravel())
    image.pack()
    world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    return world
