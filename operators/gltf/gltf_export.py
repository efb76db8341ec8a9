"""Exports a glTF file with lightmaps, images and a manifest; either all files are written or none."""

from __future__ import annotations

import filecmp
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import quote, unquote

import bpy
import numpy as np

from ...engine.errors import EngineError
from ...engine.object_message import object_message
from ...engine.outputs import LIGHT_GROUP, PROJECTED_MAPS
from ...engine.probes.godot_probes import godot_probes
from ..compat import gltf_binary_data
from ..export_options import ExportOptions, PictureOptions
from ..file_format import PLAIN
from ..result.contents import decoding, named
from ..result.destination import blend_from, try_folder
from ..result.directional_images import all_directional_images, directional_images
from ..result.file_names import file_name, numbered_names
from ..result.files import reason, replace_all, staging_folder
from ..result.images import sun_mask
from ..result.light_mixer import group_images
from ..result.light_states import baked_groups, factors, manifest_states, mixed_light
from ..result.lightmap_files import LightmapFile
from ..result.manifest import NAME, VERSION, is_ours, read_manifest, write_manifest
from ..result.moved_charts import warn_changed_uvs
from ..result.pictures import read_pixels, rec709_pixels
from ..result.preview import hide_preview, previewed, show_preview
from ..result.state_files import STATE
from ..rollback import Rollback
from ..scene import SceneContext
from ..working_space import to_rec709
from .baked_probes import baked_probes
from .complete_maps import complete_maps
from .encoded import EncodedLightmap, encode, encode_picture
from .export_items import ExportItem, ExportItems
from .exporter import write_gltf
from .gltf_nodes import read_gltf
from .godot_files import (
    LIGHT,
    MASK,
    PACKED,
    GodotFiles,
    GodotMaps,
    LitNode,
    kept_texts,
    missing_imports,
    stale_texts,
)
from .hooks import LightmapHooks, UnlitHooks
from .materials import LitMaterials, UnlitMaterials
from .mesh_differences import note_other_meshes
from .unity_files import unity_file, unity_probes

_NOTHING_BAKED = "No visible object has a lightmap, so there is nothing to export. Bake first."
_GONE = "UV layers of lightmaps are gone: {}. Bake again."
_UNREADABLE = "'{}': Godot reads no files with quotation marks or backslashes in their names. Rename it."
_AXES = "(x, -z, y) of a normal (x, y, z) in the glTF file"
_NOT_FINITE = "The lightmap '{}' has texels that are NaN or infinite. Bake again, or correct its image."
_DARK = "Without a lightmap, so dark where the engine has no lights: {}."
_MOVING = (
    "Dynamic, so dark where the engine shows no light probes: {}. Bake light probes and load them in the "
    "engine."
)

_CLEAR = (
    "Transparent, but opaque in an unlit file: {}. Export for an engine with lightmaps to keep transparency."
)

_TEXTURED = (
    "Materials with transmission and textures are opaque in Godot: {}. Use constants, or mix with a "
    "Transparent BSDF."
)

_EMITS = (
    "Emission of objects with light at vertices is not in the file, where they are unlit: {}. Set Bake To to "
    "Lightmap."
)

#: Kind of hooks of an export.
Hooks = TypeVar("Hooks", bound=LightmapHooks)

#: Characters that Godot's text files cannot hold in names of files.
_UNREAD = '"\\'


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


def export_for_engine(context: bpy.types.Context, path: Path, options: ExportOptions) -> Exported:
    """Export the visible objects as glTF with lightmaps; on EngineError no file was changed.

    path:  ends with .glb or .gltf
    """
    if path.suffix.lower() not in (".glb", ".gltf"):
        raise EngineError(f"'{path.name}' is no name of a glTF file: let it end with .glb or .gltf.")
    with _object_mode(context):
        return _export(context, path, options)


def _export(context: bpy.types.Context, path: Path, options: ExportOptions) -> Exported:
    """Export in Object Mode, the only mode that Blender's exporter supports."""
    surfaces = ExportItems(context)
    missing = [image for image in surfaces.images if not image.size[0]]
    usable = [image for image in surfaces.images if image.size[0]]
    notes = [_missing(image, surfaces) for image in missing]
    lit = dict.fromkeys(surface.source for surface in surfaces.all if surface.place is not None)
    where, uv_layer = SceneContext(context), context.scene.hemibake.uv_layer
    notes += warn_changed_uvs(lit, where)
    notes += note_other_meshes(where, surfaces.all, uv_layer)
    if not usable and not surfaces.on_vertices:
        raise EngineError("\n".join(notes) or _NOTHING_BAKED)
    changes = Rollback()
    try:
        try_folder(path.parent, changes)
        with staging_folder(path.parent) as staging, _own_materials(context):
            maps = {
                image: all_directional_images(context.scene, image) if options.use_files else {}
                for image in usable
            }
            groups = {image: _group_maps(context.scene, image) for image in usable}
            work = _Export(path, staging, maps, groups)
            hooks, found = _write(work, context, surfaces, usable, options)
            notes += found
            files = work.keep()
    except (OSError, RuntimeError) as error:
        changes.undo()
        raise EngineError(
            f"'{path.name}' cannot be written to '{path.parent}': {reason(error)}. Choose another folder."
        ) from error
    except EngineError:
        changes.undo()
        raise
    return Exported(tuple(files), len(hooks.lit) + len(hooks.colored), (*notes, *_unlit(hooks)))


def _write(
    work: _Export,
    context: bpy.types.Context,
    surfaces: ExportItems,
    usable: Sequence[bpy.types.Image],
    options: ExportOptions,
) -> tuple[LightmapHooks, list[str]]:
    """Write all files of an export with the `usable` images; return the exporter's hooks and notes."""
    scene = context.scene
    notes: list[str] = []
    if options.pictures is not None:
        pictures = complete_maps(context, surfaces, usable, options.pictures.width)
        unlit = work.write_unlit(surfaces, pictures, options.pictures)
        notes += [object_message(_CLEAR, unlit.clear)] if unlit.clear else []
        hooks: LightmapHooks = unlit
    else:
        hooks = work.write(surfaces, options, _extras(scene, work.light_groups, options))
    notes += _differences(hooks)
    if options.for_godot and usable:
        notes += work.write_godot(hooks, scene)
    elif options.use_files and usable:
        work.write_files(hooks.lit, _shown_output(scene), manifest_states(scene))
    if options.for_unity:
        notes += work.write_unity(scene)
    return hooks, notes


class _Export:
    """One export: its files are written to a staging folder, then moved to their final folder.

    maps:          directional maps of each lightmap, by output
    light_groups:  maps of light groups of each lightmap, by group
    """

    def __init__(
        self,
        path: Path,
        staging: Path,
        maps: Mapping[bpy.types.Image, dict[str, bpy.types.Image]],
        light_groups: Mapping[bpy.types.Image, dict[str, bpy.types.Image]],
    ) -> None:
        self._path, self._staging, self._maps, self.light_groups = path, staging, maps, light_groups
        self._made = staging / "files"
        self._made.mkdir()
        beside = (
            image for known in (maps, light_groups) for images in known.values() for image in images.values()
        )
        self._stems = _stems(path.stem, {image: image.name for image in (*maps, *beside)})
        self._manifest: list[Path] = []
        self._texts: dict[str, str] = {}
        self._stale: list[Path] = []

    def write(
        self, surfaces: ExportItems, options: ExportOptions, extras: Mapping[str, object]
    ) -> LightmapHooks:
        """Write the glTF file and its images; return the hooks, which list the surfaces with lightmaps.

        options:  kind of the lightmaps, and engine: transmission becomes alpha blending for Godot
        extras:   light groups and states for the file
        """
        lightmaps = {image: self._encoded(image, options.kind) for image in self._maps}
        materials = LitMaterials(gltf_binary_data(), self._uris(lightmaps))
        return self._written(LightmapHooks(surfaces, lightmaps, materials, extras, options.for_godot))

    def write_unlit(
        self, surfaces: ExportItems, pictures: Mapping[bpy.types.Image, np.ndarray], options: PictureOptions
    ) -> UnlitHooks:
        """Write the glTF file with unlit pictures, albedo x light + emission; return the hooks.

        The hooks list the surfaces.

        pictures:  picture of each lightmap, (h, w, 3) float32, linear, bottom row first
        """
        encoded = {
            image: encode_picture(image.name, pixels, options.kind, options.exposure, self._staging)
            for image, pixels in pictures.items()
        }
        materials = UnlitMaterials(gltf_binary_data(), self._uris(encoded))
        return self._written(UnlitHooks(surfaces, encoded, materials, {}))

    def _uris(self, lightmaps: dict[bpy.types.Image, EncodedLightmap]) -> dict[str, str]:
        """Return the URIs of separate image files by the lightmaps' names; empty for a .glb."""
        return {} if self._path.suffix.lower() == ".glb" else self._write_images(lightmaps)

    def _written(self, hooks: Hooks) -> Hooks:
        """Write the glTF file with hooks, and return them."""
        write_gltf(self._made / self._path.name, hooks, hooks.needs_attributes)
        if hooks.error is not None:
            raise hooks.error
        if not hooks.lit and not hooks.colored:
            raise EngineError(object_message(_GONE, hooks.lost) if hooks.lost else _NOTHING_BAKED)
        return hooks

    def write_files(self, lit: Sequence[ExportItem], shown: str, states: Mapping[str, dict]) -> None:
        """Write the lightmaps, their directional maps and light groups as OpenEXR files, with a manifest.

        shown:   name of the output that the lightmaps hold
        states:  light states for the manifest
        """
        files = []
        for lightmap, directional in self._maps.items():
            groups = {f"{LIGHT_GROUP}{name}": image for name, image in self.light_groups[lightmap].items()}
            for output, image in {shown: lightmap, **directional, **groups}.items():
                fact = {**self._facts(lightmap, lit), "output": output, **_decoding(output)}
                name = f"{self._stems[image]}.exr"
                files.append(LightmapFile(name, PLAIN, None, _finite_pixels(image), fact))
        self._write_maps(files, states)

    def write_godot(self, hooks: LightmapHooks, scene: bpy.types.Scene) -> list[str]:
        """Write the files by which Godot shows lightmaps; return notes on differences from the preview."""
        if set(self._path.name) & set(_UNREAD):
            raise EngineError(_UNREADABLE.format(self._path.name))
        gltf, output = read_gltf(self._made / self._path.name), _shown_output(scene)
        lit = [LitNode(index, surface) for index, surface in zip(hooks.nodes, hooks.lit, strict=True)]
        listed = scene.hemibake.light_states if any(self.light_groups.values()) else ()
        states = {state.name: factors(state) for state in listed}
        stems = _stems(self._path.stem, {name: name for name in states})
        maps = self._godot_maps(scene, states)
        probes = {name: godot_probes(*volume) for name, volume in baked_probes(scene).items()}
        godot = GodotFiles(
            gltf=gltf,
            name=self._path.name,
            lit=lit,
            maps=maps,
            probes=probes,
            states=stems,
            margin=scene.hemibake.margin,
        )

        def mix(image: bpy.types.Image, state: str) -> np.ndarray:
            parts = {
                name: _finite(part, read_pixels(part)) for name, part in self.light_groups[image].items()
            }
            return to_rec709(mixed_light(parts, states[state]))

        def facts(image: bpy.types.Image) -> dict:
            return {**self._facts(image, hooks.lit), "output": output}

        self._write_maps(list(godot.textures(_finite_pixels, mix, facts)))
        texts, folder = godot.texts(), self._path.parent
        kept = kept_texts(folder, texts)
        # A scene that the user has changed may use data of an earlier export.
        self._stale = [] if kept else stale_texts(folder, self._path.name, texts)
        written = {name: text for name, text in texts.items() if name not in kept}
        self._texts = {**written, **missing_imports(folder, godot.layer_counts())}
        for name, text in self._texts.items():
            (self._made / name).write_text(text, encoding="utf-8", errors="replace")
        return [*godot.notes, *kept.values()]

    def write_unity(self, scene: bpy.types.Scene) -> list[str]:
        """Write the light probes of the last bake for Unity; return notes on what is left out."""
        folder, name = self._path.parent, unity_file(self._path)
        kept = kept_texts(folder, [name])
        volumes = baked_probes(scene)
        if volumes and not kept:
            self._texts[name], notes = unity_probes(volumes)
            (self._made / name).write_text(self._texts[name], encoding="utf-8")
            return notes
        self._stale += [] if kept else [folder / name]
        return list(kept.values())

    def _godot_maps(self, scene: bpy.types.Scene, states: Iterable[str]) -> dict[bpy.types.Image, GodotMaps]:
        """Return the maps of each lightmap that Godot can show.

        states:  names of light states
        """
        kinds = {LIGHT: "", PACKED: " SH", MASK: " shadow mask"}
        kinds |= {f"{STATE}{name}": f" {STATE}{name}" for name in states}
        names = {(image, kind): f"{image.name}{end}" for image in self._maps for kind, end in kinds.items()}
        stems, found = _stems(self._path.stem, names), {}
        for image in self._maps:
            maps = directional_images(scene, image)
            files = {
                kind: f"{stems[image, kind]}.exr"
                for kind in kinds
                if self.light_groups[image] or not kind.startswith(STATE)
            }
            harmonics = maps if PROJECTED_MAPS[0] in maps else {}
            found[image] = GodotMaps(files, image, harmonics, sun_mask(scene, image))
        return found

    def _facts(self, lightmap: bpy.types.Image, lit: Sequence[ExportItem]) -> dict:
        """Return the manifest entries of a lightmap, except its output."""
        return {
            "blend": blend_from(self._path.parent),
            "export": self._path.name,
            "atlas": lightmap.name,
            "objects": [_fact(surface) for surface in lit if surface.lightmap.image == lightmap],
        }

    def _write_maps(self, files: Sequence[LightmapFile], states: Mapping[str, dict] | None = None) -> None:
        """Write image files and a manifest, with light states; None keeps the states of the old manifest."""
        for file in files:
            file.write(self._made / file.name)
        self._manifest = [self._staging / NAME]
        names, facts = [file.name for file in files], [file.entry for file in files]
        staged = [self._made / name for name in names]
        sections = {} if states is None else {"states": dict(states)}
        write_manifest(self._manifest[0], self._path.parent, staged, names, facts, sections)

    def keep(self) -> list[Path]:
        """Move all files to their folder, in place of the files of an earlier export; return their paths."""
        made = sorted(self._made.iterdir(), key=lambda path: path.name != self._path.name)
        self._refuse_others([path for path in made[1:] if path.name not in self._texts])
        staged = [*made, *self._manifest]
        paths = [self._path.parent / path.name for path in staged]
        replace_all(staged, paths, self._staging)
        for path in self._stale:
            path.unlink(missing_ok=True)
        return paths

    def _encoded(self, image: bpy.types.Image, kind: str) -> EncodedLightmap:
        """Return a lightmap encoded for the file, with the maps of its light groups."""
        groups = self.light_groups[image].items() if kind else ()
        encoded = {name: encode(part.name, _finite_pixels(part), kind) for name, part in groups}
        return replace(encode(image.name, _finite_pixels(image), kind), groups=encoded)

    def _write_images(self, lightmaps: dict[bpy.types.Image, EncodedLightmap]) -> dict[str, str]:
        """Write the lightmaps and their light groups as separate files; return their URIs by name."""
        stems = {image.name: stem for image, stem in self._stems.items()}
        uris = {}
        for lightmap in lightmaps.values():
            for part in (lightmap, *lightmap.groups.values()) if lightmap.kind else ():
                name = f"{stems[part.name]}{part.suffix}"
                (self._made / name).write_bytes(part.data)
                uris[part.name] = quote(name)
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
    """Switch to Object Mode inside the `with` block; restore mode and selection after it."""
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
    """Restore the original materials of objects that show lightmaps, inside the `with` block."""
    shown = list(previewed(context.scene))
    hide_preview(shown)
    try:
        yield
    finally:
        if shown:
            show_preview(context.scene, context.evaluated_depsgraph_get())


def _stems(stem: str, names: Mapping[Any, str]) -> dict:
    """Return the file name of each lightmap without suffix, unique regardless of case.

    names:  name of each lightmap
    """
    stems: dict = {}
    taken: set[str] = set()
    for key, name in names.items():
        numbered = numbered_names(file_name(f"{stem}.{name}"), len(names))
        stems[key] = next(name for name in numbered if name.casefold() not in taken)
        taken.add(stems[key].casefold())
    return stems


def _finite_pixels(image: bpy.types.Image) -> np.ndarray:
    """Return a lightmap's light, see `rec709_pixels`; raises EngineError for NaN or infinite values."""
    return _finite(image, rec709_pixels(image))


def _finite(image: bpy.types.Image, pixels: np.ndarray) -> np.ndarray:
    """Return the pixels of a lightmap; raises EngineError for NaN or infinite values."""
    if not np.isfinite(pixels).all():
        raise EngineError(_NOT_FINITE.format(image.name))
    return pixels


def _same_bytes(path: Path, other: Path) -> bool:
    """Return True if two paths are files with equal content; raises OSError."""
    return other.is_file() and filecmp.cmp(path, other, shallow=False)


def _referenced(path: Path) -> set[str]:
    """Return the names of the files that a .gltf file refers to as buffers and images."""
    with suppress(OSError, ValueError, AttributeError, TypeError):
        known = json.loads(path.read_text(encoding="utf-8"))
        parts = [*known.get("buffers", ()), *known.get("images", ())]
        return {unquote(part["uri"]) for part in parts if "uri" in part}
    return set()


def _group_maps(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """Return the maps of the light groups of a lightmap by group; empty if one is missing."""
    return {name: image for name, (image,) in group_images(scene, [lightmap]).items()}


def _extras(
    scene: bpy.types.Scene,
    groups: Mapping[bpy.types.Image, dict[str, bpy.types.Image]],
    options: ExportOptions,
) -> dict[str, object]:
    """Return version, light groups and states for a file, as in the manifest.

    Without light groups it is the version alone if a manifest is beside the file, else nothing.
    """
    used = {name for images in groups.values() for name in images}
    names = [name for name in baked_groups(scene) if name in used]
    if not names:
        return {"version": VERSION} if groups and options.use_files and not options.for_godot else {}
    listed = [{"name": name, "output": f"{LIGHT_GROUP}{name}"} for name in names]
    return {"version": VERSION, "groups": listed, "states": manifest_states(scene)}


def _shown_output(scene: bpy.types.Scene) -> str:
    """Return the output that objects preview, which is the first one of the bake's outputs."""
    outputs = scene.hemibake.bl_rna.properties["outputs"].enum_items.keys()
    return next(name for name in outputs if name in scene.hemibake.outputs)


def _fact(surface: ExportItem) -> dict:
    """Return the manifest's entry of an object or instance.

    The file holds final lightmap UVs: scale 1, offset 0.
    """
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
        f"The lightmap '{image.name}' of {{}} is missing ({image.filepath}). Restore the file, or bake again."
    )
    return object_message(sentence, names)


def _differences(hooks: LightmapHooks) -> list[str]:
    """Return sentences on emission and glass that the file shows in another way than Blender."""
    named = {_TEXTURED: hooks.textured, _EMITS: hooks.emitting}
    return [object_message(sentence, names) for sentence, names in named.items() if names]


def _unlit(hooks: LightmapHooks) -> Iterator[str]:
    """Yield notes on surfaces without a lightmap."""
    dark, moving = list[str](), list[str]()
    for name in hooks.dark:
        obj = bpy.data.objects.get(name)
        (moving if obj is not None and obj.hemibake.role == "DYNAMIC" else dark).append(name)
    for sentence, names in ((_GONE, hooks.lost), (_DARK, dark), (_MOVING, moving)):
        if names:
            yield object_message(sentence, list(dict.fromkeys(names)))


def _names(surfaces: Iterator[ExportItem] | Sequence[ExportItem]) -> list[str]:
    return list(dict.fromkeys(surface.source.name for surface in surfaces))
