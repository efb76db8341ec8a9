"""Compares normal maps in the preview with Cycles, and measures the time of directional maps.

The Cornell box with normals that are tilted in cells of 5 cm, and the same room without its ceiling in sun
and sky: the original in its light and the preview in the dark are rendered with the same camera; blocks of
2 x 2 pixels are compared. Light comes from the same bakes with and without directional maps.

    python tools/directional.py [--slope 0.33] [--samples 512]      # about five minutes on two cores
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tools.headless import blender

_WIDTH, _BLOCK = 128, 2

#: Cells along a side of the normal map; their width, m.
_CELLS, _CELL = 61, 0.05


def main() -> None:
    """Render and compare both scenes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--slope", type=float, default=0.33, help="root mean square of the tilted normals' slope"
    )
    parser.add_argument("--samples", type=int, default=512, help="of a pixel")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument(
        "--reflectance", type=float, default=1.0, help="factor on that of all surfaces: what bounces matter"
    )
    parser.add_argument("--scenes", nargs="+", choices=list(_SCENES), default=list(_SCENES))
    options = parser.parse_args()
    with blender(), tempfile.TemporaryDirectory() as folder:
        for name in options.scenes:
            _compare(name, _SCENES[name], options, Path(folder))


def _compare(name, make, options, folder: Path) -> None:
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    make()
    _lay_cells()
    image = _cells(options.slope)
    for material in bpy.data.materials:
        _emboss(material, image)
        _darken(material, options.reflectance)
    scene = bpy.context.scene
    original, again = (_render(scene, folder, options.samples, seed) for seed in (1, 2))
    settings = scene.hemibake
    settings.resolution, settings.samples, settings.visibility = options.resolution, 2048, "rays"
    for outputs in ({"combined"}, {"combined", "directional"}) * 2:
        settings.outputs = outputs
        bpy.ops.hemibake.bake()
        seconds = json.loads(settings.report)["seconds"]
        print(name, sorted(outputs), {key: round(value, 2) for key, value in seconds.items()}, flush=True)
    bpy.ops.hemibake.preview()
    for light in bpy.data.lights:
        light.energy = 0
    scene.world = None
    shaded = _render(scene, folder, 64)
    bpy.ops.hemibake.preview()
    settings.lightmaps["Lightmap"].directional = "NONE"
    bpy.ops.hemibake.preview()
    flat = _render(scene, folder, 64)
    counts = (original.max(axis=2) < 5) & (flat.max(axis=2) > 0)
    for title, shown in (("L0 + L1 . n", shaded), ("without", flat), ("Cycles itself, by noise", again)):
        off = np.abs(shown - original).mean(axis=2)[counts] / original.mean(axis=2)[counts]
        mean = np.abs(shown - original)[counts].mean() / original[counts].mean()
        print(f"{name}, {title}: mean {mean:.1%} of the light, median {np.median(off):.1%}", flush=True)
    both = [(shown - original)[counts] * (shown - again)[counts] for shown in (shaded, flat)]
    exact = [np.sqrt(max(product.mean(), 0)) / original[counts].mean() for product in both]
    print(f"{name}, RMS without noise: {exact[0]:.1%}, without directional maps {exact[1]:.1%}", flush=True)
    bright = shaded[counts].mean() / original[counts].mean()
    off = np.abs(shaded / bright - original).mean(axis=2)[counts] / original.mean(axis=2)[counts]
    print(f"{name}, the preview is {bright - 1:+.1%} brighter; else median {np.median(off):.1%}", flush=True)


def _cornell() -> None:
    from examples import cornell_box

    cornell_box.build()


def _yard() -> None:
    """The room without its ceiling, in the light of a sun and of a blue sky."""
    import bpy

    _cornell()
    for name in ("Ceiling", "Light", "Front Wall"):
        bpy.data.objects.remove(bpy.data.objects[name])
    scene = bpy.context.scene
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy, sun.data.angle, sun.rotation_euler = 3.0, 0.05, (0.6, 0.3, 0)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("Sky")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (0.5, 0.6, 0.8, 1)


_SCENES = {"cornell": _cornell, "yard": _yard}


def _lay_cells() -> None:
    """Give all meshes UVs "Cells" in which a unit is as long as all cells: box mapping in world space."""
    import bpy

    for obj in bpy.context.scene.objects:
        if obj.type != "MESH":
            continue
        mesh, layer = obj.data, obj.data.uv_layers.new(name="Cells")
        turn = obj.matrix_world.to_3x3()
        for face in mesh.polygons:
            axis = int(np.argmax(np.abs(turn @ face.normal)))
            for corner in face.loop_indices:
                place = obj.matrix_world @ mesh.vertices[mesh.loops[corner].vertex_index].co
                kept = [place[other] for other in range(3) if other != axis]
                layer.uv[corner].vector = [(value + 0.021 + axis) / (_CELLS * _CELL) for value in kept]


def _cells(slope: float):
    """Return a normal map of random normals, one for each cell, whose slopes have a root mean square."""
    import bpy

    # Uniform numbers in [-1/2, 1/2] have variance 1/12.
    slopes = slope * np.sqrt(6) * np.random.default_rng(1).uniform(-0.5, 0.5, (_CELLS, _CELLS, 2))
    pixels = np.ones((_CELLS, _CELLS, 4), np.float32)
    normals = np.concatenate([slopes, np.ones((_CELLS, _CELLS, 1))], axis=2)
    pixels[..., :3] = 0.5 + 0.5 * normals / np.linalg.norm(normals, axis=2, keepdims=True)
    image = bpy.data.images.new("Cells", _CELLS, _CELLS, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels.ravel())
    return image


def _emboss(material, image) -> None:
    """Feed the shader the normal map."""
    tree = material.node_tree
    uv, colour, normal = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("UVMap", "TexImage", "NormalMap"))
    uv.uv_map = normal.uv_map = "Cells"
    colour.image, colour.interpolation = image, "Closest"
    tree.links.new(uv.outputs["UV"], colour.inputs["Vector"])
    tree.links.new(colour.outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs["Normal"], tree.nodes["Principled BSDF"].inputs["Normal"])


def _darken(material, factor: float) -> None:
    """Let a surface reflect less."""
    colour = material.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    colour.default_value = (*(factor * value for value in colour.default_value[:3]), 1.0)


def _render(scene, folder: Path, samples: int, seed: int = 0) -> np.ndarray:
    """Return means of blocks of pixels, (h, w, 3)."""
    import bpy

    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", samples, False
    scene.cycles.seed = seed
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 32
    scene.cycles.device, scene.cycles.sample_clamp_indirect = "CPU", 0.0
    scene.render.resolution_x = scene.render.resolution_y = _WIDTH
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(folder / f"{len(list(folder.iterdir()))}.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    side = _WIDTH // _BLOCK
    return pixels.reshape(side, _BLOCK, side, _BLOCK, 4)[..., :3].mean(axis=(1, 3))


if __name__ == "__main__":
    main()
