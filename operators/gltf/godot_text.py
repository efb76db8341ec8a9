"""Text files that Godot 4.6 reads: a scene with lightmaps, their data, and import settings of textures.

The formats follow Godot's own text resources (format 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...engine.probes.godot_probes import GodotProbes

#: Name of the node that holds the imported glTF file.
OBJECTS = "Objects"

#: Rows of numbers that are formatted at once.
_ROWS = 1 << 12

#: Importer of texture arrays.
_IMPORTER = "2d_array_texture"


@dataclass(frozen=True)
class GodotUser:
    """A mesh that shows a lightmap.

    path:   path of its node in the imported glTF file
    slice:  index of its lightmap
    """

    path: str
    slice: int


@dataclass(frozen=True)
class GodotLightmap:
    """Data of one LightmapGI: lightmaps of equal size.

    name:       name of the node
    textures:   names of texture files, one slice or four layers of spherical harmonics each
    masks:      names of the shadow masks of the sun, one for each texture; empty without any
    is_packed:  True if the textures hold spherical harmonics
    users:      meshes that show them
    """

    name: str
    textures: tuple[str, ...]
    masks: tuple[str, ...]
    is_packed: bool
    users: tuple[GodotUser, ...]


def import_settings(layers: int) -> str:
    """Return the import settings of an image whose layers are stacked downwards: half floats, no mipmaps."""
    return (
        f'[remap]\nimporter="{_IMPORTER}"\ntype="CompressedTexture2DArray"\n[params]\ncompress/mode=3\n'
        f"mipmaps/generate=false\nslices/horizontal=1\nslices/vertical={layers}\n"
    )


def imports_layers(text: str, layers: int) -> bool:
    """Return True if the text of a .import file splits an image into this number of layers, one per row.

    Godot adds further settings to the file that the export writes.
    """
    lines = {line.strip() for line in text.splitlines()}
    wanted = {f'importer="{_IMPORTER}"', "slices/horizontal=1", f"slices/vertical={layers}"}
    return wanted <= lines


def lightmap_data(lightmap: GodotLightmap, low: np.ndarray, high: np.ndarray) -> str:
    """Return the LightmapGIData of a LightmapGI beside the node `OBJECTS`.

    low, high:  (3,) corners of the box around all meshes, y up, m; Godot shows lightmaps whose box is in view
    """
    files = (*lightmap.textures, *lightmap.masks)
    external = [
        f'[ext_resource type="CompressedTexture2DArray" path={_quoted(file)} id="{number}"]'
        for number, file in enumerate(files, 1)
    ]
    count = len(lightmap.textures)
    packed = str(lightmap.is_packed).lower()
    masks = _textures(1 + count, len(lightmap.masks))
    users = ", ".join(
        f"NodePath({_quoted(f'../{OBJECTS}/{user.path}')}), Rect2(0, 0, 1, 1), {user.slice}, -1"
        for user in lightmap.users
    )
    size = ", ".join(f"{number:.9g}" for number in (*low, *(high - low)))
    return "\n".join(
        [
            '[gd_resource type="LightmapGIData" format=3]',
            *external,
            "[resource]",
            f"lightmap_textures = {_textures(1, count)}",
            *([f"shadowmask_textures = {masks}"] if lightmap.masks else []),
            f"uses_spherical_harmonics = {packed}",
            f"_uses_packed_directional = {packed}",
            f"user_data = [{users}]",
            f'probe_data = {{"baked_exposure": 1.0, "bounds": AABB({size}), "bsp": PackedInt32Array(), '
            '"interior": false, "lightprobe_hash": 0, "points": PackedVector3Array(), '
            '"sh": PackedColorArray(), "tetrahedra": PackedInt32Array()}',
            "",
        ]
    )


def probe_volume_data(probes: GodotProbes) -> str:
    """Return the LightmapGIData of a LightmapGI that holds a volume of light probes, and no lightmaps.

    It is interior, so it lights moving objects in it, also where it overlaps boxes of lightmaps.
    """
    bounds = ", ".join(f"{number:.9g}" for number in probes.bounds.ravel())
    return "\n".join(
        [
            '[gd_resource type="LightmapGIData" format=3]',
            "[resource]",
            f'probe_data = {{"baked_exposure": 1.0, "bounds": AABB({bounds}), '
            f'"bsp": PackedInt32Array({_integers(probes.bsp)}), "interior": true, "lightprobe_hash": 0, '
            f'"points": PackedVector3Array({_floats(probes.points)}), '
            f'"sh": PackedColorArray({_floats(probes.sh, ", 1")}), '
            f'"tetrahedra": PackedInt32Array({_integers(probes.tetrahedra)})}}',
            "",
        ]
    )


def scene(model: str, lightmaps: Sequence[tuple[str, str, bool]]) -> str:
    """Return a scene with a glTF file and its lightmaps, with a black background and without tone mapping.

    model:      name of the glTF file
    lightmaps:  name and data file of each LightmapGI, and True if it has shadow masks
    """
    lines = [
        "[gd_scene format=3]",
        f'[ext_resource type="PackedScene" path={_quoted(model)} id="1"]',
        *(
            f'[ext_resource type="LightmapGIData" path={_quoted(file)} id="{number}"]'
            for number, (_, file, _) in enumerate(lightmaps, 2)
        ),
        '[sub_resource type="Environment" id="3"]',
        "background_mode = 1",
        "ambient_light_source = 1",
        "reflected_light_source = 1",
        '[node name="Baked" type="Node3D"]',
        '[node name="WorldEnvironment" type="WorldEnvironment" parent="."]',
        'environment = SubResource("3")',
        f'[node name="{OBJECTS}" parent="." instance=ExtResource("1")]',
    ]
    for number, (name, _, has_masks) in enumerate(lightmaps, 2):
        lines += [
            f'[node name="{name}" type="LightmapGI" parent="."]',
            *(["shadowmask_mode = 1"] if has_masks else []),
            f'light_data = ExtResource("{number}")',
        ]
    return "\n".join([*lines, ""])


def _textures(first: int, count: int) -> str:
    """Return an array of external textures whose ids follow each other."""
    listed = ", ".join(f'ExtResource("{number}")' for number in range(first, first + count))
    return f"Array[TextureLayered]([{listed}])"


def _floats(rows: np.ndarray, end: str = "") -> str:
    """Return numbers, (n, k), as a list, exact for float32.

    end:  text after each row
    """
    return _listed(rows, ", ".join(["%.9g"] * rows.shape[1]) + end)


def _integers(rows: np.ndarray) -> str:
    return _listed(rows, ", ".join(["%d"] * rows.shape[1]))


def _listed(rows: np.ndarray, form: str) -> str:
    """Return rows of numbers, (n, k), as a list with a format string for each; many are formatted at once."""
    parts = (rows[first : first + _ROWS] for first in range(0, len(rows), _ROWS))
    return ", ".join(", ".join([form] * len(part)) % tuple(part.ravel().tolist()) for part in parts)


def _quoted(text: str) -> str:
    """Return a text as a string of Godot's text resources."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'
