"""Renders a world without objects by Cycles, as an equirectangular map or a perspective view."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from ...compat import remove_scene, set_panorama

#: Samples per pixel of a perspective view.
_ZOOM_SAMPLES = 16

#: Width of the camera sensor and longest focal length in Blender, mm.
_SENSOR, _LONGEST = 36.0, 5000.0


@dataclass(frozen=True)
class Zoom:
    """A square perspective view.

    direction:  (3,) float64 unit vector, centre of the view
    field:      field of view, radians, below pi
    pixels:     width and height in pixels
    """

    direction: np.ndarray
    field: float
    pixels: int

    @property
    def rotation(self) -> Quaternion:
        """Rotation of the camera, which looks along its local -z axis."""
        return (-Vector(self.direction)).to_track_quat("Z", "Y")


@dataclass(frozen=True)
class Part:
    """Rectangle of pixels in an equirectangular map; rows count from the bottom."""

    rows: slice
    columns: slice

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return (self.rows.stop - self.rows.start) * (self.columns.stop - self.columns.start)

    def scaled(self, factor: int) -> Part:
        """Return the same rectangle in a map with `factor` times the pixels along each axis."""
        rows, columns = (slice(factor * axis.start, factor * axis.stop) for axis in (self.rows, self.columns))
        return Part(rows, columns)


def render_world(world: bpy.types.World, rows: int, samples: int, part: Part | None = None) -> np.ndarray:
    """Render a world's radiance as engine.Scene.world, (rows, 2 rows, 3) float32; raises RuntimeError.

    samples:  samples per pixel
    part:     rectangle of pixels to render; None for all
    """

    def set_up(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
        # The centre of an equirectangular map is the direction +x, and its upper edge is +z.
        camera.rotation_euler = (np.pi / 2, 0, -np.pi / 2)
        set_panorama(camera.data)
        render = scene.render
        scene.cycles.samples = samples
        render.resolution_x, render.resolution_y = 2 * rows, rows
        if part is not None:
            render.use_border = render.use_crop_to_border = True
            render.border_min_x, render.border_max_x = _border(part.columns, 2 * rows)
            render.border_min_y, render.border_max_y = _border(part.rows, rows)

    return _render(world, set_up)


def _border(pixels: slice, size: int) -> tuple[float, float]:
    """Return the fractions of an axis where pixels start and end; Blender rounds down to whole pixels."""
    return (pixels.start + 0.25) / size, (pixels.stop + 0.25) / size


def render_zoom(world: bpy.types.World, zoom: Zoom) -> np.ndarray:
    """Render a world's radiance in a view, (pixels, pixels, 3) float32, first row at the bottom.

    Each pixel is the mean over its square (box filter). Raises RuntimeError if Blender cannot render.
    """

    def set_up(scene: bpy.types.Scene, camera: bpy.types.Object) -> None:
        camera.rotation_euler = zoom.rotation.to_euler()
        edge = float(np.tan(zoom.field / 2))
        camera.data.lens = min(_SENSOR / (2 * edge), _LONGEST)
        camera.data.sensor_width = 2 * edge * camera.data.lens
        scene.render.resolution_x = scene.render.resolution_y = zoom.pixels
        scene.cycles.samples = _ZOOM_SAMPLES
        scene.cycles.pixel_filter_type = "BOX"

    return _render(world, set_up)


def _render(
    world: bpy.types.World, set_up: Callable[[bpy.types.Scene, bpy.types.Object], None]
) -> np.ndarray:
    """Render a world in a temporary scene, (h, w, 3) float32; raises RuntimeError.

    The user's scenes are not touched.

    set_up:  sets the camera and the resolution of the temporary scene
    """
    images = {image.session_uid for image in bpy.data.images}
    scene = bpy.data.scenes.new("hemibake")
    camera_data = bpy.data.cameras.new("hemibake")
    camera = bpy.data.objects.new("hemibake", camera_data)
    try:
        scene.world = world
        scene.collection.objects.link(camera)
        scene.camera = camera
        _set_up(scene)
        set_up(scene, camera)
        with tempfile.TemporaryDirectory(prefix="hemibake-") as folder:
            path = Path(folder) / "world.exr"
            scene.render.filepath = str(path)
            bpy.ops.render.render(write_still=True, scene=scene.name)
            return _read(path)
    finally:
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(camera_data)
        remove_scene(scene)

        # Rendering creates an image "Render Result" if the file has none.
        for image in [image for image in bpy.data.images if image.session_uid not in images]:
            bpy.data.images.remove(image)


def _set_up(scene: bpy.types.Scene) -> None:
    render = scene.render
    render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    render.resolution_percentage = 100
    render.film_transparent = False
    render.use_compositing = render.use_sequencer = False
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.image_settings.color_mode = "RGB"


def _read(path: Path) -> np.ndarray:
    """Read the pixels of an image file, (h, w, 3) float32, scene-linear."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        width, height = image.size
        return pixels.reshape(height, width, -1)[..., :3].copy()
    finally:
        bpy.data.images.remove(image)
