"""Lightmaps as float images, in Blender and on disk."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

import bpy
import numpy as np

from ...engine.errors import EngineError
from ..changes import Changes
from ..lookup import find

#: Custom property that marks an image as ours; its value is the atlas name.
MARK = "hemibake_atlas"

_LINEAR = "Linear Rec.709"


def lightmap_image(atlas: str, resolution: int, changes: Changes) -> bpy.types.Image:
    """Return our image of an atlas at a resolution, made if there is none.

    An image of that name that is not ours stays as it is: ours then gets Blender's number suffix.
    """
    image = next((item for item in bpy.data.images if item.get(MARK) == atlas), None)
    if image is None:
        image = _new_image(atlas, resolution)
        changes.add(lambda uid=image.session_uid: _remove(uid))
        return image
    changes.add(_restorer(image))
    if tuple(image.size) != (resolution, resolution):
        image.scale(resolution, resolution)
    return image


def show(image: bpy.types.Image, pixels: np.ndarray) -> None:
    """Write a lightmap, (h, w, 3) float32 scene-linear, bottom row first, into an image."""
    image.pixels.foreach_set(_rgba(pixels))
    image.update()


def store(images: list[bpy.types.Image], lightmaps: np.ndarray, directory: str) -> list[str]:
    """Write each lightmap as 32-bit EXR, let its image use the file, and return the paths.

    lightmaps  (images, h, w, 3) float32, scene-linear, bottom row first

    While the .blend has no folder that a relative `directory` could start from, the images are
    packed into it instead and the list is empty. Raises EngineError if a file cannot be written;
    files already there then stay as they were.
    """
    if directory.startswith("//") and not bpy.data.filepath:
        with tempfile.TemporaryDirectory() as folder:
            for image, path in zip(images, _write_all(images, lightmaps, Path(folder)), strict=True):
                _pack(image, path, directory)
        return []
    folder = Path(os.path.abspath(bpy.path.abspath(directory)))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as staging:
            staged = _write_all(images, lightmaps, Path(staging))
            paths = [path.replace(folder / path.name) for path in staged]
    except (OSError, RuntimeError) as error:
        raise EngineError(
            f"The lightmaps cannot be written to '{folder}': {error}. Choose another folder."
        ) from error
    for image, path in zip(images, paths, strict=True):
        _use_file(image, str(path))
    return [str(path) for path in paths]


def _new_image(atlas: str, resolution: int) -> bpy.types.Image:
    image = bpy.data.images.new(atlas, resolution, resolution, alpha=True, float_buffer=True)
    image.colorspace_settings.name = _LINEAR
    image[MARK] = atlas
    return image


def _rgba(pixels: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) as the flat RGBA float32 with alpha 1 that Blender wants."""
    rgba = np.ones((*pixels.shape[:2], 4), np.float32)
    rgba[..., :3] = pixels
    return rgba.reshape(-1)


def _write_all(images: list[bpy.types.Image], lightmaps: np.ndarray, folder: Path) -> list[Path]:
    paths = [folder / f"{file_name(image.name)}.exr" for image in images]
    for path, pixels in zip(paths, lightmaps, strict=True):
        _write_exr(path, pixels)
    return paths


def file_name(name: str) -> str:
    """Return a datablock's name without the characters that file systems refuse."""
    return re.sub(r'[<>:"/\\|?*\x00-\x1f]', "_", name)


def _write_exr(path: Path, pixels: np.ndarray) -> None:
    """Write pixels bit-exact.

    `Image.save` converts generated float images to the display's colours unless they are marked as
    data, so a data image that lives only here is saved.
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("hemibake", width, height, alpha=True, float_buffer=True, is_data=True)
    try:
        image.pixels.foreach_set(_rgba(pixels))
        image.filepath_raw = str(path)
        image.file_format = "OPEN_EXR"
        image.save()
    finally:
        bpy.data.images.remove(image)


def _use_file(image: bpy.types.Image, path: str) -> None:
    """Let an image show a file, with a path relative to the .blend where there is one."""
    _forget(image)
    image.source = "FILE"
    image.filepath_raw = path
    image.reload()
    image.colorspace_settings.name = _LINEAR
    if bpy.data.filepath:
        image.filepath_raw = _relative(path)


def _forget(image: bpy.types.Image) -> None:
    """Drop the pixels and the packed file of an image; Blender drops pixels when the source changes."""
    if image.packed_file:
        image.unpack(method="REMOVE")
    image.source = "GENERATED"


def _relative(path: str) -> str:
    """Return a path relative to the .blend; as it is where there is no such path (another drive)."""
    try:
        return bpy.path.relpath(path)
    except ValueError:
        return path


def _pack(image: bpy.types.Image, path: Path, directory: str) -> None:
    """Pack a file into an image, under the path it would have in `directory`."""
    _forget(image)
    image.source = "FILE"
    image.filepath_raw = f"{directory.rstrip('/')}/{path.name}"
    data = path.read_bytes()
    image.pack(data=data, data_len=len(data))
    image.colorspace_settings.name = _LINEAR


def _remove(uid: int) -> None:
    image = find(bpy.data.images, uid)
    if image is not None:
        bpy.data.images.remove(image)


def _restorer(image: bpy.types.Image):
    """Return a step that gives an image the pixels and the file it has now."""
    uid, size, source = image.session_uid, tuple(image.size), image.source
    path, dirty = image.filepath_raw, image.is_dirty
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)

    def restore() -> None:
        image = find(bpy.data.images, uid)
        if image is None:
            return
        image.source, image.filepath_raw = source, path
        if source == "FILE" and not dirty:
            image.reload()
        if tuple(image.size) != size:
            image.scale(*size)
        image.pixels.foreach_set(pixels)
        image.update()

    return restore
