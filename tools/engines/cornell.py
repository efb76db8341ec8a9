"""The baked Cornell box in Blender's preview, the reference for engines."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import bpy

ROOT = Path(__file__).resolve().parents[2]

#: The wall that the camera looks through: glTF knows no visibility to cameras.
HIDDEN = ("Front Wall",)

#: Width of the normal map, texels.
_BUMPS = 5


#: Light states of the box: color and strength of each light group.
STATES = {
    "Day": {},
    "Night": {"Lamp": ((1.0, 0.5, 0.25), 0.125), "Blue": ((0.5, 0.75, 1.0), 3.0)},
    "Dark": {"Lamp": ((0.0, 0.0, 0.0), 1.0)},
}


def bake(*arguments: Any, **settings: Any) -> None:
    """Build the box in an empty file and bake it; takes the arguments of `build`."""
    import bpy

    build(*arguments, **settings)
    bpy.ops.hemibake.bake()


def build(
    resolution: int = 192,
    quality: str = "high",
    directional: str | None = None,
    states: bool = False,
    file_format: str = "exr",
    folder: Path | None = None,
) -> None:
    """Build the box in an empty file, with settings of the bake.

    directional:  output that tells where light comes from; its surfaces then have a normal map
    states:       True to add a blue lamp, a light group for each of both lights, and STATES
    file_format:  format of the files of the bake
    folder:       folder of these files; None to pack the lightmaps
    """
    import bpy

    sys.path.insert(0, str(ROOT / "examples"))
    import cornell_box

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    cornell_box.build()
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.file_format = quality, resolution, file_format
    if folder is not None:
        settings.directory = str(folder)
    if directional:
        _emboss()
        settings.outputs = {"combined", directional}
    if states:
        _add_states()
        settings.outputs |= {"light_groups"}


def _add_states() -> None:
    """Add a blue lamp, both light groups and STATES."""
    import bpy

    scene, lamp = bpy.context.scene, bpy.data.lights.new("Blue", "POINT")
    lamp.energy, lamp.color = 20.0, (0.1, 0.2, 1.0)
    blue = bpy.data.objects.new("Blue", lamp)
    blue.location = (-0.6, -0.5, 0.5)
    scene.collection.objects.link(blue)
    for name, obj in (("Lamp", bpy.data.objects["Light"]), ("Blue", blue)):
        bpy.context.view_layer.lightgroups.add(name=name)
        obj.lightgroup = name
    for name, mix in STATES.items():
        state = scene.hemibake.light_states.add()
        state.name = name
        for group, (color, strength) in mix.items():
            entry = state.groups.add()
            entry.name, entry.color, entry.strength = group, color, strength


def _emboss() -> None:
    """Give all faces the UVs of a square, and all materials a normal map of wide, soft bumps."""
    import bpy

    for mesh in bpy.data.meshes:
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
        uvs = mesh.uv_layers.new(name="Bumps").uv
        uvs.foreach_set("vector", np.tile(corners, (len(mesh.polygons), 1)).ravel())
    image = _bumps()
    for material in bpy.data.materials:
        tree = material.node_tree
        uv, colour, normal = (
            tree.nodes.new(f"ShaderNode{kind}") for kind in ("UVMap", "TexImage", "NormalMap")
        )
        uv.uv_map = normal.uv_map = "Bumps"
        colour.image = image
        tree.links.new(uv.outputs["UV"], colour.inputs["Vector"])
        tree.links.new(colour.outputs["Color"], normal.inputs["Color"])
        tree.links.new(normal.outputs["Normal"], tree.nodes["Principled BSDF"].inputs["Normal"])


def _bumps() -> bpy.types.Image:
    """Return a normal map of a few texels, enlarged by interpolation, with slopes up to 0.4."""
    import bpy

    slopes = np.random.default_rng(7).uniform(-0.4, 0.4, (_BUMPS, _BUMPS, 2))
    normals = np.concatenate([slopes, np.ones((_BUMPS, _BUMPS, 1))], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    pixels = np.concatenate([0.5 + 0.5 * normals, np.ones((_BUMPS, _BUMPS, 1))], axis=2)
    image = bpy.data.images.new("Bumps", _BUMPS, _BUMPS)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    return image


def preview(width: int, folder: Path) -> np.ndarray:
    """Return the preview as Cycles renders it, (width, width, 3) float32, linear, bottom row first.

    Surfaces only emit, and a filter that is almost a point samples the middle of each pixel, as engines do.
    """
    import bpy

    scene = bpy.context.scene
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 1
    scene.cycles.max_bounces, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 0, False, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.view_settings.view_transform = "Raw"
    return render_preview(folder / "preview.exr", width, width)


def render_preview(path: Path, width: int, height: int) -> np.ndarray:
    """Render the preview with the settings of the scene; return (h, w, 3) float32, linear, bottom row first.

    path:  of the OpenEXR file that is written
    """
    import bpy

    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(path)
    bpy.ops.hemibake.preview()
    bpy.ops.render.render(write_still=True)
    bpy.ops.hemibake.preview()
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[..., :3]


def export_states(folder: Path, width: int, engine: str = "FILES") -> dict[str, np.ndarray]:
    """Bake the box with STATES and write room.glb for an engine; return the preview of each state.

    width:  of the pictures, pixels; see `preview`
    """
    import bpy

    bake(96, "preview", states=True)
    wanted = {}
    for name in STATES:
        bpy.ops.hemibake.light_state_apply(name=name)
        wanted[name] = preview(width, folder)
    bpy.ops.hemibake.export_for_engine(filepath=str(folder / "room.glb"), engine=engine)
    return wanted


def export(folder: Path, kind: str = "NONE", engine: str = "FILES") -> Path:
    """Write the box as .glb for an engine, or with lightmaps of a kind in it, and return its path."""
    import bpy

    path = folder / "cornell.glb"
    bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps=kind, engine=engine)
    return path


def differences(shown: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return how far each pixel is off, (n,), of its brightest channel, where anything is shown."""
    brightest = wanted.max(axis=-1)
    lit = brightest > 0
    return np.abs(shown - wanted).max(axis=-1)[lit] / brightest[lit]
