"""Lightmap images in Blender and their files."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import bpy
import numpy as np

from ...engine.errors import EngineError
from ...engine.outputs import RATIO_MAPS
from ..lookup import find
from ..rollback import Rollback
from ..working_space import REC709, from_rec709, is_rec709
from .destination import Destination
from .exr import rgba, write_exr
from .files import reason, replace_all, staging_folder
from .light_states import states_section
from .lightmap_files import LightmapFile, lightmap_files
from .manifest import NAME, write_manifest
from .pictures import DATA, holds_colours
from .probe_files import ProbeFile, probe_sections
from .reflection_files import ReflectionFile, reflection_sections

#: Custom property that marks a lightmap image; its value is the atlas name.
MARK = "hemibake_atlas"

#: Custom property of an image: True if a bake packed it: without a folder, after a write error,
#: or in Live.
_PACKED = "hemibake_packed"


def map_name(atlas: str, output: str) -> str:
    """Return the name of a companion map: the map of another output beside a lightmap.

    Both the image and its entry in the scene's list use it.
    """
    return f"{atlas} {output.replace('_', ' ', 1)}"


def lightmap_image(scene: bpy.types.Scene, atlas: str, resolution: int, changes: Rollback) -> bpy.types.Image:
    """Return a scene's image of an atlas at a resolution, created if there is none.

    An image that another scene uses too, as after copying a scene, is left to that scene. A foreign image
    with the name stays unchanged; the new image then gets Blender's number suffix. A new image becomes the
    scene's own with `remember`.
    """
    entry = scene.hemibake.lightmaps.get(atlas)
    image = entry and entry.image
    if image is None or _belongs_to_another(image, scene):
        image = _new_image(scene, atlas, resolution)
        changes.add(partial(_remove, image.session_uid))
        return image
    changes.add(_restorer(image))
    _set_space(image)
    if tuple(image.size) != (resolution, resolution):
        image.scale(resolution, resolution)
    return image


def remember(scene: bpy.types.Scene, atlas: str, image: bpy.types.Image, beside: str = "") -> None:
    """Store a scene's image of an atlas; an undo step must follow.

    An undo frees images that no undo step holds, but does not change scenes that no step has changed. A
    pointer from such a scene to such an image would crash Blender.

    beside:  atlas of which this is a further output's map; empty for the atlas itself
    """
    entry = scene.hemibake.lightmaps.get(atlas)
    if entry is None:
        entry = scene.hemibake.lightmaps.add()
        entry.name = atlas
    entry.image, entry.companion_of = image, beside


def show(image: bpy.types.Image, pixels: np.ndarray) -> None:
    """Write a lightmap, (h, w, 3) float32, linear Rec.709, bottom row first, into an image."""
    image.pixels.foreach_set(rgba(from_rec709(pixels) if holds_colours(image) else pixels))
    image.update()


def store(
    images: list[bpy.types.Image],
    lightmaps: np.ndarray,
    destination: Destination,
    facts: list[dict],
    states: Mapping[str, dict],
    probes: Sequence[ProbeFile] = (),
    cubes: Sequence[ReflectionFile] = (),
    has_patch: np.ndarray | None = None,
) -> list[LightmapFile]:
    """Write the files of lightmaps, probes and cubes, assign shown files to images, return the lightmaps'.

    Images that the user has packed stay packed. Without a folder the images are packed into the .blend, and
    there are no files. If writing fails, old files stay, the images are packed, and EngineError is raised.

    images:     images that show the lightmaps already
    lightmaps:  (images, h, w, 3) float32, scene-linear, bottom row first
    facts:      manifest entries of each
    states:     light states of the scene for the manifest
    probes:     files of light probes
    cubes:      files of reflection cubes
    has_patch:  (atlases, h, w) bool, texels of charts, for mip levels; None if unknown
    """
    if destination.folder is None:
        _pack_all(images, lightmaps, destination)
        return []
    files = list(lightmap_files(lightmaps, destination, facts, has_patch))
    try:
        write_all(files, destination, states, probes, cubes)
    except (OSError, RuntimeError) as error:
        _pack_all(images, lightmaps, destination)
        raise EngineError(
            f"The lightmaps cannot be written to '{destination.folder}': {reason(error)}. They are packed "
            "into the .blend instead: save it, or choose another folder and bake again."
        ) from error
    for image, path in zip(images, destination.paths, strict=True):
        _use_file(image, str(path))
    return files


def _set_space(image: bpy.types.Image) -> None:
    """Set the color space of a lightmap image."""
    suffixes = tuple(map_name("", output) for output in RATIO_MAPS)
    is_ratio = not is_rec709() and image[MARK].endswith(suffixes)
    space = DATA if is_ratio else REC709
    if image.colorspace_settings.name != space:
        image.colorspace_settings.name = space


def _belongs_to_another(image: bpy.types.Image, scene: bpy.types.Scene) -> bool:
    others = (other for other in bpy.data.scenes if other != scene)
    return any(entry.image == image for other in others for entry in other.hemibake.lightmaps)


def _new_image(scene: bpy.types.Scene, atlas: str, resolution: int) -> bpy.types.Image:
    """Return a new image, named after the scene too if another scene has a lightmap of that name."""
    same = bpy.data.images.get(atlas)
    name = f"{atlas} {scene.name}" if same is not None and _belongs_to_another(same, scene) else atlas
    image = bpy.data.images.new(name, resolution, resolution, alpha=True, float_buffer=True)
    image[MARK] = atlas
    _set_space(image)
    return image


def write_all(
    files: Sequence[LightmapFile],
    destination: Destination,
    states: Mapping[str, dict],
    probes: Sequence[ProbeFile] = (),
    cubes: Sequence[ReflectionFile] = (),
) -> None:
    """Write all files and the manifest, or none; raises OSError or RuntimeError.

    The manifest is replaced first and lists old and new files.

    states:  light states of the scene for the manifest
    probes:  files of light probes
    cubes:   files of reflection cubes
    """
    folder, names = destination.folder, [file.name for file in files]
    assert folder is not None
    with staging_folder(folder) as staging:
        staged = [staging / f"{index}{Path(name).suffix}" for index, name in enumerate(names)]
        others: dict[str, Sequence[ProbeFile | ReflectionFile]] = {"probes": probes, "cubes": cubes}
        staged_probes, staged_cubes = (
            [staging / f"{kind}{index}{Path(file.name).suffix}" for index, file in enumerate(group)]
            for kind, group in others.items()
        )
        all_files: list[LightmapFile | ProbeFile | ReflectionFile] = [*files, *probes, *cubes]
        for path, file in zip([*staged, *staged_probes, *staged_cubes], all_files, strict=True):
            file.write(path)
        owner = {"blend": destination.blend, "scene": destination.scene}
        manifest, entries = staging / NAME, [{**owner, **file.entry} for file in files]
        sections: dict[str, dict | list] = {
            **states_section(states, destination),
            **probe_sections(destination, staged_probes, probes),
            **reflection_sections(destination, staged_cubes, cubes),
        }
        write_manifest(manifest, folder, staged, names, entries, sections)
        names += [file.name for group in others.values() for file in group]
        all_staged = [manifest, *staged, *staged_probes, *staged_cubes]
        replace_all(all_staged, [folder / name for name in (NAME, *names)], staging)


def _use_file(image: bpy.types.Image, path: str) -> None:
    """Assign a file to an image, with a path relative to the .blend if possible."""
    is_packed = _is_packed_by_user(image)
    image.pop(_PACKED, None)
    _forget(image)
    image.source = "FILE"
    image.filepath_raw = path
    image.reload()
    _set_space(image)
    if bpy.data.filepath:
        image.filepath_raw = _relative(path)
    if is_packed:
        image.pack()


def pack_for_bake(image: bpy.types.Image) -> None:
    """Pack an image until a bake writes its file again."""
    image[_PACKED] = not _is_packed_by_user(image)
    image.pack()


def _is_packed_by_user(image: bpy.types.Image) -> bool:
    """Return True if the user, not a bake, has packed an image into the .blend."""
    return image.packed_file is not None and not image.get(_PACKED, False)


def _forget(image: bpy.types.Image) -> None:
    """Drop the pixels and the packed file of an image, by changing its source."""
    if image.packed_file:
        image.unpack(method="REMOVE")
    image.source = "GENERATED"


def _relative(path: str) -> str:
    """Return a path relative to the .blend; unchanged on another drive."""
    try:
        return bpy.path.relpath(path)
    except ValueError:
        return path


def _pack_all(images: list[bpy.types.Image], lightmaps: np.ndarray, destination: Destination) -> None:
    """Pack the images into the .blend under the paths that their files would have."""
    for image, pixels, name in zip(images, lightmaps, destination.names, strict=True):
        image[_PACKED] = not _is_packed_by_user(image)
        image.filepath_raw = f"{destination.packed_as.rstrip('/')}/{name}"
        if is_rec709():
            image.pack()
        else:
            _pack_file(image, pixels)
        image.packed_files[0].filepath = image.filepath_raw


def _pack_file(image: bpy.types.Image, pixels: np.ndarray) -> None:
    """Pack pixels as a file in the image's color space; Blender would use its working space."""
    with tempfile.TemporaryDirectory(prefix="hemibake-") as folder:
        path = Path(folder) / "lightmap.exr"
        write_exr(path, pixels, is_colour=holds_colours(image))
        data, named = path.read_bytes(), image.filepath_raw
    _forget(image)
    image.source, image.filepath_raw = "FILE", named
    image.pack(data=data, data_len=len(data))
    _set_space(image)


def _remove(uid: int) -> None:
    image = find(bpy.data.images, uid)
    if image is not None:
        bpy.data.images.remove(image)


def _restorer(image: bpy.types.Image) -> Callable[[], None]:
    """Return a function that restores the image's present pixels and file."""
    uid, size, source = image.session_uid, tuple(image.size), image.source
    path, dirty = image.filepath_raw, image.is_dirty
    packed = image.packed_file and image.packed_file.data
    pixels = _pixels(image)

    def restore() -> None:
        image = find(bpy.data.images, uid)
        if image is None:
            return
        _forget(image)
        image.source, image.filepath_raw = source, path
        if packed:
            image.pack(data=packed, data_len=len(packed))
            image.packed_files[0].filepath = path
        elif source == "FILE" and os.path.exists(bpy.path.abspath(path)):
            image.reload()
        _set_space(image)
        if tuple(image.size) != size:
            image.scale(*size)
        if dirty or (_pixels(image) != pixels).any():
            image.pixels.foreach_set(pixels)
            image.update()

    return restore


def _pixels(image: bpy.types.Image) -> np.ndarray:
    """Return an image's pixels, flat float32 RGBA."""
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels


def sun_mask(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> bpy.types.Image | None:
    """Return the shadow mask of a lightmap for the first sun that has one; None without one."""
    if "shadow_mask" not in scene.hemibake.outputs:
        return None
    entry = next((entry for entry in scene.hemibake.lightmaps if entry.image == lightmap), None)
    if entry is None:
        return None
    suns = [obj.name for obj in scene.objects if obj.type == "LIGHT" and obj.data.type == "SUN"]
    masks = (scene.hemibake.lightmaps.get(map_name(entry.name, f"shadow_mask {name}")) for name in suns)
    return next((mask.image for mask in masks if mask and mask.image and mask.image.size[0]), None)
