"""Files by which Godot 4.6 shows the lightmaps of an exported glTF file, without a plug-in."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from glob import escape
from pathlib import Path

import bpy
import numpy as np

from ...engine.object_message import object_message
from ...engine.outputs import PROJECTED_MAPS
from ...engine.probes.godot_probes import GodotProbes
from ..file_format import FileFormat
from ..result.file_names import file_name
from ..result.lightmap_files import LightmapFile
from ..result.state_files import STATE
from .export_items import ExportItem
from .gltf_nodes import mesh_bounds
from .godot_nodes import mesh_paths
from .godot_text import (
    GodotLightmap,
    GodotUser,
    import_settings,
    imports_layers,
    lightmap_data,
    probe_volume_data,
    scene,
)
from .signed_text import is_unchanged, signed

#: Godot stores textures of light as half floats.
_HALF = FileFormat(depth=16)

#: Kinds of texture files: the lightmap, all four maps of spherical harmonics in one, and a shadow mask. The
#: last two are also the names of their outputs.
LIGHT, PACKED, MASK = "", "SH packed", "shadow_mask"

#: Decoding of these layers, for a normal n with y up.
_DECODE = "4 layers from top to bottom: L0, y, z, x; light = L0 (1 + 4 v . n), v = 2 layer - 1, y up"

#: Layers of spherical harmonics.
_HARMONICS = 4

#: Maximum number of LightmapGI nodes that Godot shows at once.
_MOST = 8

#: Texels beside a chart that Godot's bicubic filter reads.
_FILTER = 2

_NO_MESH = (
    "Godot makes no mesh of these objects, because it gives the end of their names a meaning: {}. Rename "
    "them, and export again."
)
_NO_HARMONICS = (
    "Godot's lightmaps shade normal maps by spherical harmonics, which these objects have not: {}. Bake with "
    "the output Spherical Harmonics."
)
_TOO_MANY = (
    f"Godot shows at most {_MOST} LightmapGI nodes at once, and these lightmaps need {{}}. Use fewer sizes "
    "of lightmaps, and bake again."
)
_NARROW = (
    f"Godot's filter reads {_FILTER} texels next to a chart, and Margin is {{}}. Set it to {_FILTER} or "
    "more, and bake again."
)
_KEPT = "'{}' was changed since the last export, so it is kept. Delete it and export again for a new one."


@dataclass(frozen=True)
class LitNode:
    """A node of an exported glTF file with its lightmap.

    index:    index of the node in the file
    surface:  object or instance that it shows
    """

    index: int
    surface: ExportItem


@dataclass(frozen=True)
class GodotMaps:
    """Maps of a lightmap that Godot can show.

    files:      names of the files of LIGHT, of PACKED harmonics and of the MASK, by these constants, and of
                light states, by STATE and their name, if the lightmap has light groups
    light:      image of E/pi
    harmonics:  images of PROJECTED_MAPS by name; empty without any
    mask:       image of the shadow mask of the sun; None without one
    """

    files: Mapping[str, str]
    light: bpy.types.Image
    harmonics: Mapping[str, bpy.types.Image]
    mask: bpy.types.Image | None


class GodotFiles:
    """Files beside a glTF file: textures, import settings, data of LightmapGI nodes, and a scene.

    gltf:    contents of the glTF file
    name:    its file name
    lit:     its nodes with lightmaps
    maps:    maps of each lightmap
    probes:  volumes of light probes by name of their node
    states:  name without ending of the data files of each light state, by name of the state
    margin:  texels by which charts are extended
    """

    def __init__(
        self,
        gltf: Mapping,
        name: str,
        lit: Sequence[LitNode],
        maps: Mapping[bpy.types.Image, GodotMaps],
        probes: Mapping[str, GodotProbes],
        states: Mapping[str, str],
        margin: int,
    ) -> None:
        self._probes = probes
        self._gltf, self._name, self._maps = gltf, name, maps
        self._paths = mesh_paths(gltf)
        self._lit = sorted((node for node in lit if node.index in self._paths), key=lambda node: node.index)
        self._lost = [node.surface.source.name for node in lit if node.index not in self._paths]
        self._margin = margin
        self._packed = {node.index for node in self._lit if self._is_packed(node)}
        self._lightmaps = list(self._grouped())
        self._data = {f"{Path(name).stem}.{lightmap.name}.tres": lightmap for lightmap in self._lightmaps}
        self._scene_data = list(self._data)
        for state, stem in states.items():
            self._data |= self._mixed(state, stem)

    @property
    def notes(self) -> list[str]:
        """Sentences on what Godot shows in another way than Blender."""
        flat = [
            node.surface.source.name
            for node in self._lit
            if self._has_normal_map(node) and node.index not in self._packed
        ]
        notes: list[str] = [object_message(_NO_MESH, _unique(self._lost))] if self._lost else []
        notes += [object_message(_NO_HARMONICS, _unique(flat))] if flat else []
        notes += [_TOO_MANY.format(len(self._lightmaps))] if len(self._lightmaps) > _MOST else []
        return notes + ([_NARROW.format(self._margin)] if self._margin < _FILTER else [])

    def textures(
        self,
        read: Callable[[bpy.types.Image], np.ndarray],
        mix: Callable[[bpy.types.Image, str], np.ndarray],
        facts: Callable[[bpy.types.Image], dict],
    ) -> Iterator[LightmapFile]:
        """Yield the texture files.

        read:   returns the pixels of an image, (h, w, 3) float32, bottom row first
        mix:    returns a lightmap in a light state in the same form
        facts:  returns the manifest entries of a lightmap
        """
        for image, kind in self._used():
            maps, entry = self._maps[image], facts(image)
            if kind == PACKED:
                light = _layers([read(maps.harmonics[name]) for name in PROJECTED_MAPS])
                entry |= {"output": PACKED, "decode": _DECODE}
            elif kind == MASK:
                light = read(maps.mask)
                entry |= {"output": MASK}
            elif kind.startswith(STATE):
                light = mix(image, kind[len(STATE) :])
                entry |= {"output": kind}
            else:
                light = read(maps.light)
            yield LightmapFile(maps.files[kind], _HALF, None, light, entry)

    def texts(self) -> dict[str, str]:
        """Return the text files by name, except import settings."""
        low, high = mesh_bounds(self._gltf)
        texts = {name: lightmap_data(lightmap, low, high) for name, lightmap in self._data.items()}
        nodes = [
            (lightmap.name, file, bool(lightmap.masks))
            for lightmap, file in zip(self._lightmaps, self._scene_data, strict=True)
        ]
        for name, volume in self._probes.items():
            file = f"{Path(self._name).stem}.{file_name(name)}.tres"
            texts[file] = probe_volume_data(volume)
            nodes.append((name, file, False))
        texts[f"{Path(self._name).stem}.tscn"] = scene(self._name, nodes)
        return {name: signed(f"{_owner(self._name)}\n{text}") for name, text in texts.items()}

    def layer_counts(self) -> dict[str, int]:
        """Return the number of layers of each texture file, by name."""
        return {
            self._maps[image].files[kind]: _HARMONICS if kind == PACKED else 1 for image, kind in self._used()
        }

    def _used(self) -> list[tuple[bpy.types.Image, str]]:
        """Return lightmap and kind of each texture file."""
        files = {name for lightmap in self._data.values() for name in (*lightmap.textures, *lightmap.masks)}
        return [
            (image, kind)
            for image, maps in self._maps.items()
            for kind, name in maps.files.items()
            if name in files
        ]

    def _mixed(self, state: str, stem: str) -> dict[str, GodotLightmap]:
        """Return the LightmapGI nodes that look otherwise in a light state, by name of their data file.

        Spherical harmonics have no light groups, so their nodes have no states.
        """
        changed = {
            maps.files[LIGHT]: maps.files[f"{STATE}{state}"]
            for maps in self._maps.values()
            if f"{STATE}{state}" in maps.files
        }
        found = {}
        for lightmap in self._lightmaps:
            textures = tuple(changed.get(name, name) for name in lightmap.textures)
            if textures != lightmap.textures:
                found[f"{stem}.{lightmap.name}.tres"] = replace(lightmap, textures=textures)
        return found

    def _grouped(self) -> Iterator[GodotLightmap]:
        """Yield a LightmapGI for each size of lightmaps, and for each kind of light."""
        groups: dict[tuple[int, int, str], dict[bpy.types.Image, list[LitNode]]] = {}
        for node in self._lit:
            image = node.surface.lightmap.image
            kind = PACKED if node.index in self._packed else LIGHT
            groups.setdefault((*image.size, kind), {}).setdefault(image, []).append(node)
        for (width, height, kind), nodes in groups.items():
            size = str(width) if width == height else f"{width}x{height}"
            maps = [self._maps[image] for image in nodes]
            yield GodotLightmap(
                f"Lightmap {size}{' SH' if kind == PACKED else ''}",
                tuple(part.files[kind] for part in maps),
                tuple(part.files[MASK] for part in maps) if all(part.mask for part in maps) else (),
                kind == PACKED,
                tuple(
                    GodotUser(self._paths[node.index], number)
                    for number, group in enumerate(nodes.values())
                    for node in group
                ),
            )

    def _is_packed(self, node: LitNode) -> bool:
        """Return True if spherical harmonics light a node: it has a normal map, and they were baked.

        The lightmap itself is more exact where there is no normal map.
        """
        return bool(self._maps[node.surface.lightmap.image].harmonics) and self._has_normal_map(node)

    def _has_normal_map(self, node: LitNode) -> bool:
        materials = self._gltf.get("materials", ())
        primitives = self._gltf["meshes"][self._gltf["nodes"][node.index]["mesh"]]["primitives"]
        used = [part["material"] for part in primitives if "material" in part]
        return any("normalTexture" in materials[number] for number in used)


def _owner(model: str) -> str:
    """Return the comment that names the glTF file to which a text file belongs."""
    return f"; Lightmaps of {model}"


def stale_texts(folder: Path, model: str, names: Container[str]) -> list[Path]:
    """Return the data files in a folder that an earlier export of a glTF file wrote, unless changed since.

    names:  files that belong to the present export
    """
    return [
        path
        for path in folder.glob(f"{escape(Path(model).stem)}.*.tres")
        if path.name not in names
        and is_unchanged(path)
        and _owner(model) in path.read_text("utf-8").splitlines()[:2]
    ]


def kept_texts(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the text files in a folder that were changed since an export wrote them, and a note on each.

    Raises OSError.
    """
    changed = [name for name in names if (folder / name).exists() and not is_unchanged(folder / name)]
    return {name: _KEPT.format(name) for name in changed}


def missing_imports(folder: Path, layers: Mapping[str, int]) -> dict[str, str]:
    """Return the import settings of textures by file name, except those in a folder that fit; raises OSError.

    Godot completes import settings, and users may change them.

    layers:  number of layers of each texture, by file name
    """
    made = {}
    for name, count in layers.items():
        path = folder / f"{name}.import"
        fits = path.exists() and imports_layers(path.read_text(encoding="utf-8", errors="replace"), count)
        if not fits:
            made[path.name] = import_settings(count)
    return made


def _layers(maps: Sequence[np.ndarray]) -> np.ndarray:
    """Return SH L0 and SH L1 x, y, z of Blender's axes as Godot's layers, stacked downwards.

    Godot's light = L0 (1 + 4 v . n) with v = 2 layer - 1 equals SH L0 (1 + 2 SH L1 . n) for v = SH L1 / 2.
    Godot's (x, y, z) is Blender's (x, z, -y).

    maps:  (h, w, 3) float32 each, bottom row first
    """
    l0, x, y, z = maps
    stacked = [l0, *(0.5 + 0.25 * part for part in (z, -y, x))]
    return np.concatenate(stacked[::-1])


def _unique(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))
