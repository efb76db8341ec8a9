"""Cycles' render of the open scene, lit by its lights or by lightmaps alone."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np


def aim(location: tuple[float, float, float], target: tuple[float, float, float]) -> None:
    """Add a camera."""
    from mathutils import Vector

    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    camera.location = location
    camera.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = camera


def render(size: tuple[int, int], samples: int, exposure: float) -> np.ndarray:
    """Render with Cycles; return sRGB colours, (h, w, 3), bottom row first."""
    with tempfile.TemporaryDirectory() as folder:
        return _rendered(Path(folder) / "render.png", size, samples, exposure)


def _rendered(path: Path, size: tuple[int, int], samples: int, exposure: float) -> np.ndarray:
    """Render into a file and read it."""
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.seed = samples, False, 1
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", exposure
    scene.render.image_settings.file_format, scene.render.filepath = "PNG", str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(size[1], size[0], -1)[..., :3]


def show_lightmaps(names: tuple[str, ...], images: np.ndarray, albedo: float) -> None:
    """Let every mesh emit its lightmap, times an albedo; its UVs are the layer of the scene's settings."""
    layer = bpy.context.scene.hemibake.uv_layer
    for index, name in enumerate(names):
        for obj in bpy.context.scene.objects:
            if obj.type == "MESH":
                obj.data.materials.clear()
                obj.data.materials.append(_emitting(name, images[index], layer, albedo))


def _emitting(name: str, pixels: np.ndarray, layer: str, albedo: float) -> bpy.types.Material:
    """Return a material that shows an image, (h, w, 3), by a UV layer."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(f"{name} shown", width, height, alpha=False, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(np.dstack([pixels, np.ones((height, width))]).astype(np.float32).ravel())
    image.pack()
    material = bpy.data.materials.new(f"{name} shown")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    uv, texture, emission, output = (
        tree.nodes.new(f"ShaderNode{kind}") for kind in ("UVMap", "TexImage", "Emission", "OutputMaterial")
    )
    uv.uv_map, texture.image, texture.extension = layer, image, "EXTEND"
    emission.inputs["Strength"].default_value = albedo
    tree.links.new(uv.outputs["UV"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return material
