"""Files of reflection cubes: OpenEXR, Radiance HDR and KTX2 of each sphere, and the manifest entries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...engine.bake_result import ReflectionCube
from ...engine.encoding.encoding import encode_in_bands
from ...engine.encoding.ktx2 import ktx2_cube
from ...engine.encoding.radiance import radiance_bytes
from ...engine.encoding.rgbe import Rgbe
from ...engine.scene.reflection_sphere import ReflectionSphere, ReflectionVolume
from ..file_format import PLAIN
from .destination import Destination
from .exr import write_exr
from .manifest import checksum
from .object_files import ObjectFiles

#: Key of the manifest.
SECTION = "reflections"

#: Endings of the files of a sphere.
ENDINGS = (".exr", ".hdr", ".ktx2")

#: Meaning of faces and pictures, for readers of the manifest.
_LAYOUT = (
    "faces +x, -x, +y, -y, +z, -z of a cube map with y up and z forward, left-handed: look up (x, z, y) of a "
    "direction in Blender, (x, y, -z) of one in glTF. KTX2 has all levels; in EXR and HDR level k is a row "
    "of six faces, its top 2 size (1 - 2^-k) pixels below the top"
)


@dataclass(frozen=True)
class ReflectionFile:
    """File of a reflection cube: a strip of all levels (.exr, .hdr), or a cube map (.ktx2).

    name:   file name with extension
    cube:   radiance of all levels
    entry:  entry of the manifest for all files, without checksums
    """

    name: str
    cube: ReflectionCube
    entry: dict

    def write(self, path: Path) -> None:
        """Write the file to a path; raises OSError or RuntimeError."""
        if self.name.endswith(".exr"):
            write_exr(path, cube_strip(self.cube.levels), PLAIN)
        elif self.name.endswith(".hdr"):
            path.write_bytes(radiance_bytes(encode_in_bands(Rgbe(), cube_strip(self.cube.levels))))
        else:
            path.write_bytes(ktx2_cube(self.cube.levels))


def cube_strip(levels: Sequence[np.ndarray]) -> np.ndarray:
    """Return a picture of all levels, (h, 6 s, 3) float32, bottom row first: rows of six faces, left-aligned.

    levels:  (6, s, s, 3) float32 each, top row first; the largest is at the top of the picture
    """
    rows = [np.concatenate(list(level), axis=1) for level in levels]
    strip = np.zeros((sum(len(row) for row in rows), rows[0].shape[1], 3), np.float32)
    top = 0
    for row in rows:
        strip[top : top + len(row), : row.shape[1]] = row
        top += len(row)
    return strip[::-1]


def reflection_files(
    cubes: Sequence[ReflectionCube],
    spheres: Sequence[ReflectionSphere],
    origin: np.ndarray,
    destination: Destination,
) -> list[ReflectionFile]:
    """Return the files of the reflection cubes of a bake, three for each; none without a folder.

    Files are named after the .blend and the sphere. A file of another program is never replaced; the new file
    gets a number instead.

    spheres:  all spheres of the scene, which the cubes refer to
    origin:   (3,) float64, world space: the point to which the spheres are relative
    """
    if destination.folder is None:
        return []
    known, files = ObjectFiles(destination.folder, destination, SECTION, _checksums), list[ReflectionFile]()
    for cube in cubes:
        sphere = spheres[cube.sphere]
        entry = _entry(known.stem(sphere.name, "Reflection", _names), cube, sphere, origin, destination)
        files += [ReflectionFile(file, cube, entry) for file in entry["files"]]
    return files


def _names(stem: str) -> list[str]:
    """Return the names of the files of a sphere."""
    return [f"{stem}{ending}" for ending in ENDINGS]


def reflection_sections(
    destination: Destination, staged: Sequence[Path], files: Sequence[ReflectionFile]
) -> dict[str, list[dict]]:
    """Return the section of the manifest after a bake with reflection files; empty without any.

    Cubes of other .blend files and scenes stay.

    staged:  written files
    """
    if not files or destination.folder is None:
        return {}
    sums = {file.name: checksum(path) for path, file in zip(staged, files, strict=True)}
    entries = {file.entry["files"][0]: file.entry for file in files}
    mine = [{**entry, "sha256": [sums[name] for name in entry["files"]]} for entry in entries.values()]
    return {SECTION: ObjectFiles(destination.folder, destination, SECTION, _checksums).section(mine)}


def _checksums(entry: dict) -> dict[str, str]:
    """Return the checksums of the files of an entry, by file."""
    return dict(zip(entry.get("files", ()), entry.get("sha256", ()), strict=False))


def _entry(
    stem: str, cube: ReflectionCube, sphere: ReflectionSphere, origin: np.ndarray, destination: Destination
) -> dict:
    """Return the manifest entry of a cube, whose files have a stem."""
    count = len(cube.levels)
    return {
        "name": sphere.name,
        "blend": destination.blend,
        "scene": destination.scene,
        "files": _names(stem),
        "size": cube.levels[0].shape[1],
        "roughness": [level / (count - 1) for level in range(count)],
        "position": (sphere.position + origin).tolist(),
        "influence": {**_volume(sphere.influence, origin), "falloff": sphere.falloff},
        "parallax": _volume(sphere.parallax, origin),
        "layout": _LAYOUT,
    }


def _volume(volume: ReflectionVolume, origin: np.ndarray) -> dict:
    """Return the manifest entry of a volume."""
    matrix = volume.matrix.copy()
    matrix[:3, 3] += origin
    return {"shape": volume.shape, "matrix": matrix.tolist()}
