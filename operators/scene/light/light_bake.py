"""Evaluates light nodes by Cycles: bakes the direct light that a light sends to small squares around it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix

from ....engine.scene.profile import Profile
from ...compat import new_node_tree, plain_lamp, remove_scene
from ..scene_context import SceneContext
from ..temporary_scene import share_values
from .light_node_reader import LightNodes

#: Azimuth and polar angles of a measured light profile, and of the coarse grid that detects if light varies
#: with direction.
_AZIMUTHS, _POLARS = 361, 181
_FEW = 9, 7

#: Samples of each measuring square: for point, spot and sun lights, and for area lights, whose samples are
#: spread over the face of the light.
_SAMPLES, _FACE_SAMPLES = 1, 256

#: Geometry of the squares. _WIDTH is the width of a square as a fraction of its distance. _DISTANCE is the
#: distance from the light in m, and _FAR the distance from area lights in light widths.
_WIDTH = 1e-3
_DISTANCE, _FAR = 1.0, 30.0

#: Axes whose scale is a smaller fraction of the largest scale are treated as unscaled, and so is scale 0.
#: Otherwise all squares would overlap, and each ray would hit tens of thousands of them.
_FLAT = 1e-3

#: Light counts as equal in all directions if its factors differ by less than this fraction of the largest.
_EVEN = 1e-3

#: Radiance above which a measurement is invalid (see engine.scene.checks.MAX_RADIANCE).
_MOST = 1e20


def bake_lamp(lamp: bpy.types.Light, matrix: np.ndarray, context: SceneContext) -> LightNodes:
    """Measure the factors that a light's nodes apply to its power; raises RuntimeError if Cycles fails.

    A point or spot light gets a profile of directions in steps of 1 degree, measured 1 m away. A sun gets one
    colour. An area light gets the mean colour over its face, along its axis.

    matrix:   (4, 4) float64, light space to world space
    context:  context of the scene with the light
    """
    if lamp.type in {"SUN", "AREA"}:
        return LightNodes(_lit(lamp, matrix, np.array([[0.0, 0.0, -1.0]]), context)[0])
    colours = _lit(lamp, matrix, _grid(*_FEW), context)
    if np.ptp(colours, axis=0).max() <= _EVEN * colours.max():
        return LightNodes(colours.mean(axis=0))
    factors = _lit(lamp, matrix, _grid(_AZIMUTHS, _POLARS), context).reshape(_AZIMUTHS, _POLARS, 3)
    factors[-1] = factors[0]
    azimuths, polars = np.linspace(0, 2 * np.pi, _AZIMUTHS), np.linspace(0, np.pi, _POLARS)
    return LightNodes(
        profile=Profile(azimuths.astype(np.float32), polars.astype(np.float32), factors.astype(np.float32))
    )


def _grid(azimuths: int, polars: int) -> np.ndarray:
    """Return unit directions at the angles of a profile, (azimuths * polars, 3) float64, in light space."""
    azimuth = np.linspace(0, 2 * np.pi, azimuths)[:, None] - np.pi
    polar = np.linspace(0, np.pi, polars)
    x, y = np.sin(azimuth) * np.sin(polar), np.cos(azimuth) * np.sin(polar)
    return np.stack([x, y, np.broadcast_to(-np.cos(polar), x.shape)], axis=2).reshape(-1, 3)


def _lit(
    lamp: bpy.types.Light, matrix: np.ndarray, directions: np.ndarray, context: SceneContext
) -> np.ndarray:
    """Measure the factors of a light's nodes for directions in light space, (n, 3) -> (n, 3) float64 RGB."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    axes = matrix[:3, :3] / np.where(scale > 0, scale, 1)
    away = directions / np.where(scale > _FLAT * scale.max(), scale, 1) @ axes.T
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-30)
    distance = _DISTANCE
    if lamp.type == "AREA":
        distance = _FAR * max(float(max(lamp.size, lamp.size_y) * scale.max()), 1e-3)
    samples = _FACE_SAMPLES if lamp.type == "AREA" else _SAMPLES
    mesh = _squares(away, distance, matrix[:3, 3])
    with _stage(lamp, matrix, mesh, distance, context) as (scene, squares, image):
        scene.cycles.samples = samples
        with bpy.context.temp_override(
            scene=scene, view_layer=scene.view_layers[0], active_object=squares, object=squares,
            selected_objects=[squares], selected_editable_objects=[squares],
        ):  # fmt: skip
            bpy.ops.object.bake(
                type="DIFFUSE", pass_filter={"DIRECT"}, margin=0, use_clear=True, target="IMAGE_TEXTURES",
                save_mode="INTERNAL", use_selected_to_active=False,
            )  # fmt: skip
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
    factors = pixels.reshape(-1, 4)[: len(directions), :3].astype(np.float64)
    if not (np.isfinite(factors).all() and factors.max() < _MOST):
        raise RuntimeError("its nodes give no number")
    return np.maximum(factors, 0)


def _squares(away: np.ndarray, distance: float, centre: np.ndarray) -> bpy.types.Mesh:
    """Return a mesh of squares at a distance around a centre, facing it, each with one texel of its own.

    away:  (n, 3) float64, unit directions from the centre to the squares
    """
    other = np.where(np.abs(away[:, 2:]) < 0.9, [[0.0, 0, 1]], [[1.0, 0, 0]])
    x = np.cross(other, away)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(away, x)
    outline = np.array([(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)])
    offsets = outline[:, 0, None] * x[:, None] + outline[:, 1, None] * y[:, None]
    corners = centre + distance * (away[:, None] + _WIDTH * offsets)
    width = _image_width(len(away))
    cell = np.stack([np.arange(len(away)) % width, np.arange(len(away)) // width], axis=1)

    # Arrays are set directly, since `from_pydata` takes ten times as long for the 65,341 squares of a
    # profile.
    mesh = bpy.data.meshes.new("hemibake")
    mesh.vertices.add(4 * len(away))
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.add(4 * len(away))
    mesh.loops.foreach_set("vertex_index", np.arange(4 * len(away), dtype=np.int32))
    mesh.polygons.add(len(away))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * len(away), 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    uvs = (cell[:, None] + outline + 0.5) / width
    mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", uvs.astype(np.float32).ravel())
    return mesh


def _image_width(texels: int) -> int:
    return int(np.ceil(np.sqrt(texels)))


@contextmanager
def _stage(
    lamp: bpy.types.Light, matrix: np.ndarray, mesh: bpy.types.Mesh, distance: float, context: SceneContext
) -> Iterator[tuple[bpy.types.Scene, bpy.types.Object, bpy.types.Image]]:
    """Set up a scene with the light and white diffuse squares, and remove it at the end.

    The light's power is such that the baked light equals the factors of its nodes.
    """
    scene = bpy.data.scenes.new("hemibake")
    white = bpy.data.materials.new("hemibake")
    width = _image_width(len(mesh.polygons))
    image = bpy.data.images.new("hemibake", width, width, alpha=True, float_buffer=True, is_data=True)
    shining = plain_lamp(lamp.copy())
    squares, light = bpy.data.objects.new("hemibake", mesh), bpy.data.objects.new("hemibake", shining)
    try:
        _paint(white, image)
        mesh.materials.append(white)
        shining.energy = np.pi if lamp.type == "SUN" else (2 * np.pi * distance) ** 2
        if lamp.type == "AREA":
            shining.energy /= 4
        light.matrix_world = Matrix(matrix.tolist())
        for obj in (squares, light):
            scene.collection.objects.link(obj)
        scene.render.engine, scene.cycles.device = "CYCLES", "CPU"
        scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
        scene.cycles.sample_clamp_direct = 0
        share_values(context, scene)
        scene.view_layers[0].update()
        yield scene, squares, image
    finally:
        for obj in (squares, light):
            bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)
        bpy.data.lights.remove(shining)
        remove_scene(scene)
        bpy.data.materials.remove(white)
        bpy.data.images.remove(image)


def _paint(material: bpy.types.Material, image: bpy.types.Image) -> None:
    """Make a material white and diffuse, with an image as its bake target."""
    tree = new_node_tree(material)
    tree.nodes.clear()
    output, diffuse = (tree.nodes.new(f"ShaderNode{name}") for name in ("OutputMaterial", "BsdfDiffuse"))
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.nodes.active = node
