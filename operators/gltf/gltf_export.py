"""Exports a glTF file with lightmaps, images and a manifest; either all files are written or none."""

from __future__ import annotations

import filecmp
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, unquote

import bpy
import numpy as np

from ...engine.errors import EngineError
from ...engine.object_message import object_message
from ..command_line.pictures import read_pixels
from ..compat import gltf_binary_data
from ..file_format import PLAIN
from ..result.contents import decoding, named
from ..result.destination import blend_from, try_folder
from ..result.directional_images import all_directional_images
from ..result.file_names import file_name
from ..result.files import reason, replace_all, staging_folder
from ..result.lightmap_files import LightmapFile
from ..result.manifest import NAME, is_ours, read_manifest, write_manifest
from ..result.moved_charts import warn_changed_uvs
from ..result.preview import hide_preview, previewed, show_preview
from ..rollback import Rollback
from ..scene import SceneContext
from .encoded import EncodedLightmap, encode
from .export_items import ExportItem, ExportItems
from .exporter import write_gltf
from .hooks import LightmapHooks
from .materials import LitMaterials
from .mesh_differences import note_other_meshes

_NOTHING_BAKED = "No object that is shown has a lightmap, so there is nothing to export. Bake first."
_GONE = "UV layers of lightmaps are gone: {}. Bake again."
_AXES = "(x, -z, y) of a normal (x, y, z) in the glTF file"
_NOT_FINITE = "The lightmap '{}' has texels that are NaN or infinite. Bake again, or mend its image."
_DARK = "Without a lightmap, so dark where the engine has no lights: {}."


@dataclass(frozen=True)
class Exported:
    """Result of an export.

    files:  paths of the written files, the glTF file first
    lit:    number of objects and instances with lightmaps
    notes:  sentences on objects without lightmaps
    """

    files: tuple[Path, ...]
    lit: int
    notes: tuple[str, ...]


def export_for_engine(context: bpy.types.Context, path: Path, kind: str, use_files: bool) -> Exported:
    """Export the visible objects as glTF with lightmaps; on EngineError no file was changed.

    path:       ends with .glb or .gltf
    kind:       MIME type of the lightmaps in the file; "" for none
    use_files:  True to write the lightmaps as OpenEXR files with a manifest as well
    """
    if path.suffix.lower() not in (".glb", ".gltf"):
        raise EngineError(f"'{path.name}' is no name of a glTF file: let it end with .glb or .gltf.")
    with _object_mode(context):
        return _export(context, path, kind, use_files)


def _export(context: bpy.types.Context, path: Path, kind: str, use_files: bool) -> Exported:
    """Export in Object Mode, the only mode that Blender's exporter supports."""
    surfaces = ExportItems(context)
    missing = [image for image in surfaces.images if not image.size[0]]
    usable = [image for image in surfaces.images if image.size[0]]
    notes = [_missing(image, surfaces) for image in missing]
    lit = dict.fromkeys(surface.source for surface in surfaces.all if surface.place is not None)
    where, uv_layer = SceneContext(context), context.scene.hemibake.uv_layer
    notes += warn_changed_uvs(lit, where)
    notes += note_other_meshes(where, surfaces.all, uv_layer)
    if not usable:
        raise EngineError("\n".join(notes) or _NOTHING_BAKED)
    changes = Rollback()
    try:
        try_folder(path.parent, changes)
        with staging_folder(path.parent) as staging, _own_materials(context):
            maps = {
                image: all_directional_images(context.scene, image) if use_files else {} for image in usable
            }
            work = _Export(path, staging, maps)
            hooks = work.write(surfaces, kind)
            if use_files:
                work.write_files(hooks.lit, _shown_output(context.scene))
            files = work.keep()
    except (OSError, RuntimeError) as error:
        changes.undo()
        raise EngineError(
            f"'{path.name}' cannot be written to '{path.parent}': {reason(error)}. Choose another folder."
        ) from error
    except EngineError:
        changes.undo()
        raise
    return Exported(tuple(files), len(hooks.lit), (*notes, *_unlit(hooks)))


class _Export:
    """Files of one export, made in a staging folder.

    maps:  directional maps of each lightmap, by output
    """

    def __init__(
        self, path: Path, staging: Path, maps: Mapping[bpy.types.Image, dict[str, bpy.types.Image]]
    ) -> None:
        self._path, self._staging, self._maps = path, staging, maps
        self._made = staging / "files"
        self._made.mkdir()
        self._stems = _stems(
            path.stem, [*maps, *(image for beside in maps.values() for image in beside.values())]
        )
        self._manifest: list[Path] = []

    def write(self, surfaces: ExportItems, kind: str) -> LightmapHooks:
        """Write the glTF file and its images; return the hooks, which list the surfaces with lightmaps."""
        lightmaps = {image: encode(image.name, _finite_pixels(image), kind) for image in self._maps}
        uris = {} if self._path.suffix.lower() == ".glb" else self._write_images(lightmaps)
        hooks = LightmapHooks(surfaces, lightmaps, LitMaterials(gltf_binary_data(), uris))
        write_gltf(self._made / self._path.name, hooks)
        if hooks.error is not None:
            raise hooks.error
        if not hooks.lit:
            raise EngineError(object_message(_GONE, hooks.lost) if hooks.lost else _NOTHING_BAKED)
        return hooks

    def write_files(self, lit: Sequence[ExportItem], shown: str) -> None:
        """Write the lightmaps and their directional maps as OpenEXR files, with a manifest of their objects.

        shown:  name of the output that the lightmaps hold
        """
        folder, files = self._path.parent, []
        for lightmap, directional in self._maps.items():
            objects = [_fact(surface) for surface in lit if surface.place.image == lightmap]
            origin = {"blend": blend_from(folder), "export": self._path.name, "atlas": lightmap.name}
            for output, image in {shown: lightmap, **directional}.items():
                fact = {**origin, "output": output, **_decoding(output), "objects": objects}
                name = f"{self._stems[image]}.exr"
                files.append(LightmapFile(name, PLAIN, None, _finite_pixels(image), fact))
        for file in files:
            file.write(self._made / file.name)
        self._manifest = [self._staging / NAME]
        names, facts = [file.name for file in files], [file.entry for file in files]
        write_manifest(self._manifest[0], folder, [self._made / name for name in names], names, facts)

    def keep(self) -> list[Path]:
        """Move all files to their folder, in place of the files of an earlier export; return their paths."""
        made = sorted(self._made.iterdir(), key=lambda path: path.name != self._path.name)
        self._refuse_others(made[1:])
        staged = [*made, *self._manifest]
        paths = [self._path.parent / path.name for path in staged]
        replace_all(staged, paths, self._staging)
        return paths

    def _write_images(self, lightmaps: dict[bpy.types.Image, EncodedLightmap]) -> dict[str, str]:
        """Write the lightmaps as separate files; return their URIs by the lightmaps' names."""
        uris = {}
        for image, lightmap in lightmaps.items():
            if not lightmap.kind:
                continue
            name = f"{self._stems[image]}{lightmap.suffix}"
            (self._made / name).write_bytes(lightmap.data)
            uris[lightmap.name] = quote(name)
        return uris

    def _refuse_others(self, made: Sequence[Path]) -> None:
        """Raise EngineError if a file would be overwritten that no earlier export of this file wrote.

        Equal files are allowed, as exports to one folder may share textures.
        """
        folder, before = self._path.parent, _referenced(self._path)
        known, blend = read_manifest(folder), blend_from(folder)
        others = [
            path.name
            for path in made
            if (folder / path.name).exists()
            and path.name not in before
            and not is_ours(known, folder / path.name, blend)
            and not _same_bytes(path, folder / path.name)
        ]
        if others:
            raise EngineError(
                f"'{others[0]}' in '{folder}' is not of an earlier export of '{self._path.name}'. "
                "Choose another name or folder."
            )


@contextmanager
def _object_mode(context: bpy.types.Context) -> Iterator[None]:
    """Switch to Object Mode for the duration of the context, then restore mode and selection."""
    if context.mode == "OBJECT":
        yield
        return
    objects, mode = context.view_layer.objects, context.view_layer.objects.active.mode
    edited = [obj for obj in objects if obj.mode == mode]
    selected = [obj for obj in objects if obj.select_get()]
    bpy.ops.object.mode_set(mode="OBJECT")
    try:
        yield
    finally:
        # Blender switches the mode of all selected objects.
        _select(objects, edited)
        bpy.ops.object.mode_set(mode=mode)
        _select(objects, selected)


def _select(objects: Iterable[bpy.types.Object], selected: Sequence[bpy.types.Object]) -> None:
    for obj in objects:
        obj.select_set(obj in selected)


@contextmanager
def _own_materials(context: bpy.types.Context) -> Iterator[None]:
    """Restore the original materials of objects that preview lightmaps, for the duration of the context."""
    shown = list(previewed(context.scene))
    hide_preview(shown)
    try:
        yield
    finally:
        if shown:
            show_preview(context.scene, context.evaluated_depsgraph_get())


def _stems(stem: str, images: Sequence[bpy.types.Image]) -> dict[bpy.types.Image, str]:
    """Return file names for lightmaps without suffix, unique regardless of case."""
    stems, taken = {}, set()
    for image in images:
        base = file_name(f"{stem}.{image.name}")
        names = (base if not number else f"{base}.{number:03d}" for number in range(len(images)))
        stems[image] = next(name for name in names if name.casefold() not in taken)
        taken.add(stems[image].casefold())
    return stems


def _finite_pixels(image: bpy.types.Image) -> np.ndarray:
    """Return a lightmap's colours, see `read_pixels`; raises EngineError for NaN or infinite ones."""
    pixels = read_pixels(image)
    if not np.isfinite(pixels).all():
        raise EngineError(_NOT_FINITE.format(image.name))
    return pixels


def _same_bytes(path: Path, other: Path) -> bool:
    """Return whether two paths are files with equal content; raises OSError."""
    return other.is_file() and filecmp.cmp(path, other, shallow=False)


def _referenced(path: Path) -> set[str]:
    """Return the names of the files that a .gltf file refers to as buffers and images."""
    with suppress(OSError, ValueError, AttributeError, TypeError):
        known = json.loads(path.read_text(encoding="utf-8"))
        parts = [*known.get("buffers", ()), *known.get("images", ())]
        return {unquote(part["uri"]) for part in parts if "uri" in part}
    return set()


def _shown_output(scene: bpy.types.Scene) -> str:
    """Return the output that objects preview, which is the first one of the bake's outputs."""
    outputs = scene.hemibake.bl_rna.properties["outputs"].enum_items.keys()
    return next(name for name in outputs if name in scene.hemibake.outputs)


def _fact(surface: ExportItem) -> dict:
    """Return the manifest's entry of an object or instance; the UVs in the file are final lightmap UVs."""
    instance = {"instancer": surface.instancer, "persistent_id": list(surface.persistent_id)}
    place = {"uv_layer": "TEXCOORD_1", "scale": 1.0, "offset": [0.0, 0.0]}
    return {**named(surface.source), **(instance if surface.instancer is not None else {}), **place}


def _decoding(output: str) -> dict[str, str]:
    """Return the decoding formulas of a directional map for a file with y up; empty for other outputs."""
    return {name: f"{formula}: {_AXES}" for name, formula in decoding(output).items()}


def _missing(image: bpy.types.Image, surfaces: ExportItems) -> str:
    """Return a note about a lightmap whose image cannot be read."""
    names = _names(
        surface for surface in surfaces.all if surface.place is not None and surface.place.image == image
    )
    sentence = (
        f"The lightmap '{image.name}' of {{}} is missing ({image.filepath}). Bring it back, or bake again."
    )
    return object_message(sentence, names)


def _unlit(hooks: LightmapHooks) -> Iterator[str]:
    """Yield notes on surfaces without a lightmap."""
    for sentence, names in ((_GONE, hooks.lost), (_DARK, hooks.dark)):
        if names:
            yield object_message(sentence, list(dict.fromkeys(names)))


def _names(surfaces: Iterator[ExportItem] | Sequence[ExportItem]) -> list[str]:
    return list(dict.fromkeys(surface.source.name for surface in surfaces))
