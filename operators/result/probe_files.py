"""Files of light probes: OpenEXR atlases and a KTX2 texture of each volume, and the manifest entries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ...engine.bake_result import ProbeGrid
from ...engine.encoding.ktx2 import ktx2_volume
from ...engine.probes.bevy_volume import bevy_voxels
from ...engine.probes.distance_atlas import BORDER, MAP_WIDTH, distance_atlas
from ...engine.probes.spherical_harmonics import windowed
from ...engine.scene.probe_volume import ProbeVolume
from ..file_format import PLAIN
from .destination import Destination
from .exr import write_exr
from .file_names import file_name, numbered_names
from .manifest import checksum
from .object_files import ObjectFiles

#: Key of the manifest.
SECTION = "probes"

#: Coefficients of a probe, each an RGB block of the atlas; one more block holds the validity.
COEFFICIENTS = 9

#: Validity of probes that moved out of geometry.
MOVED = 0.5

#: Endings of the atlas and of the texture of a volume.
_ATLAS, _TEXTURE = ".exr", ".ktx2"

#: Meaning of the blocks and rows, for readers of the manifest.
_LAYOUT = (
    "pixel (block * nx + i, k * ny + j) of probe (i, j, k), rows from the bottom; blocks 0-8: RGB of "
    "1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2; block 9: validity in R"
)


#: Endings of the files of distances and of the offsets of moved probes.
_DISTANCES, _OFFSETS = f"_Distances{_ATLAS}", f"_Offsets{_ATLAS}"

#: Meaning of both files, for readers of the manifest.
_DISTANCE_LAYOUT = (
    "octahedral map of probe (i, j, k): texels (u, v) at (10 i + 1 + u, 10 (k ny + j) + 1 + v), rows from "
    "the bottom, with a border of 1 texel; R mean distance in m, G mean squared distance. offsets: pixel "
    "(i, k ny + j), RGB offset of the probe in m, Blender's axes"
)

#: Contents of a file: the pixels of an OpenEXR file, (h, w, 3) float32, bottom row first, or bytes.
Content = Callable[[], np.ndarray | bytes]


@dataclass(frozen=True)
class ProbeFile:
    """File of a probe volume.

    name:     file name with extension
    content:  function that makes the contents
    entry:    entry of the manifest for all files of the volume, without checksums
    """

    name: str
    content: Content
    entry: dict

    @property
    def is_first(self) -> bool:
        """True for the atlas of all light, the first file of a volume."""
        return self.name == self.entry["file"]

    def write(self, path: Path) -> None:
        """Write the file to a path; raises OSError or RuntimeError."""
        content = self.content()
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            write_exr(path, content, PLAIN, is_colour=False)


def probe_atlas(grid: ProbeGrid, group: str | None = None) -> np.ndarray:
    """Return the atlas of a grid, (ny nz, 10 nx, 3) float32, bottom row first; see `read_atlas`.

    Coefficients are windowed where E/pi would be negative.

    group:  light group; None for all light
    """
    x, y, z = grid.resolution
    validity = np.zeros((len(grid.validity), 1, 3), np.float32)
    validity[:, 0, 0] = grid.validity
    light = grid.coefficients if group is None else grid.groups[group]
    blocks = np.concatenate([windowed(light), validity], axis=1)
    return blocks.reshape(z * y, x, COEFFICIENTS + 1, 3).swapaxes(1, 2).reshape(z * y, -1, 3)


def read_atlas(atlas: np.ndarray, resolution: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients, (n, 9, 3), and validity, (n,), of an atlas, (h, w, 3) float32, bottom row up."""
    x, y, z = resolution
    blocks = atlas.reshape(z * y, COEFFICIENTS + 1, x, 3).swapaxes(1, 2).reshape(-1, COEFFICIENTS + 1, 3)
    return np.ascontiguousarray(blocks[:, :COEFFICIENTS]), blocks[:, COEFFICIENTS, 0].copy()


def probe_files(grids: Sequence[ProbeGrid], origin: np.ndarray, destination: Destination) -> list[ProbeFile]:
    """Return the files of the probe volumes of a bake; none without a folder.

    Each volume has an atlas, ambient cubes for Bevy (.ktx2), an atlas for each light group, and perhaps
    distances with offsets, named after the .blend and the volume. A file of another program is never
    replaced; the new file gets a number instead.

    origin:  (3,) float64, world space: the point to which the grids are relative
    """
    if destination.folder is None:
        return []
    known, files = ObjectFiles(destination.folder, destination, SECTION, _checksums), list[ProbeFile]()
    for grid in grids:
        stem = known.stem(grid.name, "Probes", partial(_contents, grid=grid))
        entry = _entry(stem, grid, origin, destination)
        files += [ProbeFile(name, content, entry) for name, content in _contents(stem, grid).items()]
    return files


def _contents(stem: str, grid: ProbeGrid) -> dict[str, Content]:
    """Return the contents of all files of a volume, by name."""
    contents: dict[str, Content] = {
        f"{stem}{_ATLAS}": partial(probe_atlas, grid),
        f"{stem}{_TEXTURE}": partial(_bevy_texture, grid),
    }
    if len(grid.distances):
        contents[f"{stem}{_DISTANCES}"] = partial(distance_atlas, grid.distances, grid.resolution)
        contents[f"{stem}{_OFFSETS}"] = partial(probe_offsets, grid)
    groups = _group_files(stem, grid)
    return contents | {file: partial(probe_atlas, grid, group) for group, file in groups.items()}


def _bevy_texture(grid: ProbeGrid) -> bytes:
    """Return a KTX2 file of ambient cubes for Bevy."""
    return ktx2_volume(bevy_voxels(windowed(grid.coefficients), grid.resolution))


def probe_offsets(grid: ProbeGrid) -> np.ndarray:
    """Return the offsets of moved probes from their places in the grid, (ny nz, nx, 3) float32, m."""
    x, y, z = grid.resolution
    moves = grid.positions - ProbeVolume(grid.name, grid.matrix, grid.resolution).points()
    offsets = np.where(grid.validity[:, None] == MOVED, moves, 0).astype(np.float32)
    return offsets.reshape(z * y, x, 3)


def _group_files(stem: str, grid: ProbeGrid) -> dict[str, str]:
    """Return the file of each light group of a volume; names differ, ignoring case."""
    files, others = dict[str, str](), {f"{stem}{ending}".casefold() for ending in (_DISTANCES, _OFFSETS)}
    for group in grid.groups:
        base, taken = file_name(f"{stem}_{group}"), {*others, *(file.casefold() for file in files.values())}
        numbered = (f"{name}{_ATLAS}" for name in numbered_names(base, len(grid.groups) + len(others)))
        files[group] = next(file for file in numbered if file.casefold() not in taken)
    return files


def probe_sections(
    destination: Destination, staged: Sequence[Path], files: Sequence[ProbeFile]
) -> dict[str, list[dict]]:
    """Return the section of the manifest after a bake with probe files; empty without any.

    Volumes of other .blend files and scenes stay.

    staged:  written files
    """
    if not files or destination.folder is None:
        return {}
    sums = {file.name: checksum(path) for path, file in zip(staged, files, strict=True)}
    mine = [_with_checksums(file.entry, sums) for file in files if file.is_first]
    return {SECTION: ObjectFiles(destination.folder, destination, SECTION, _checksums).section(mine)}


def _with_checksums(entry: dict, sums: Mapping[str, str]) -> dict:
    """Return an entry of the manifest with the checksums of its files."""
    made = {**entry, "sha256": sums[entry["file"]], "ktx2_sha256": sums[entry["ktx2"]]}
    if "groups" in entry:
        made["groups"] = [{**group, "sha256": sums[group["file"]]} for group in entry["groups"]]
    if "distances" in entry:
        files = entry["distances"]
        digests = {"sha256": sums[files["file"]], "offsets_sha256": sums[files["offsets"]]}
        made["distances"] = {**files, **digests}
    return made


def _checksums(entry: dict) -> dict[str, str]:
    """Return the checksums of the files of an entry, by file."""
    distances = entry.get("distances", {})
    parts = entry, distances, *entry.get("groups", ())
    sums = {part.get("file", ""): part.get("sha256", "") for part in parts}
    others = {distances.get("offsets", ""): distances.get("offsets_sha256", "")}
    return sums | others | {entry.get("ktx2", ""): entry.get("ktx2_sha256", "")}


def _entry(stem: str, grid: ProbeGrid, origin: np.ndarray, destination: Destination) -> dict:
    """Return the manifest entry of a volume, whose files have a stem."""
    matrix = grid.matrix.copy()
    matrix[:3, 3] += origin
    filled, moved = (int((grid.validity == value).sum()) for value in (0, MOVED))
    groups = [{"name": group, "file": file} for group, file in _group_files(stem, grid).items()]
    return {
        "name": grid.name,
        "blend": destination.blend,
        "scene": destination.scene,
        "file": f"{stem}{_ATLAS}",
        "ktx2": f"{stem}{_TEXTURE}",
        "resolution": list(grid.resolution),
        "matrix": matrix.tolist(),
        "coefficients": "radiance SH L2",
        "layout": _LAYOUT,
        "validity": {"filled": filled, "moved": moved, "block": COEFFICIENTS},
        **({"groups": groups} if groups else {}),
        **({"distances": _distances(stem, grid)} if len(grid.distances) else {}),
    }


def _distances(stem: str, grid: ProbeGrid) -> dict:
    """Return the part of the manifest entry about the distances of a volume."""
    return {
        "file": f"{stem}{_DISTANCES}",
        "offsets": f"{stem}{_OFFSETS}",
        "size": MAP_WIDTH,
        "border": BORDER,
        "limit": ProbeVolume(grid.name, grid.matrix, grid.resolution).reach,
        "layout": _DISTANCE_LAYOUT,
    }
