"""Files of light probes: an OpenEXR atlas and a KTX2 texture of each volume, and the manifest entries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ...engine.bake_result import ProbeGrid
from ...engine.encoding.ktx2 import ktx2_volume
from ...engine.probes.bevy_volume import bevy_voxels
from ...engine.probes.spherical_harmonics import windowed
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

#: Endings of both files of a volume.
_ATLAS, _TEXTURE = ".exr", ".ktx2"

#: Meaning of the blocks and rows, for readers of the manifest.
_LAYOUT = (
    "pixel (block * nx + i, k * ny + j) of probe (i, j, k), rows from the bottom; blocks 0-8: RGB of "
    "1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2; block 9: validity in R"
)


@dataclass(frozen=True)
class ProbeFile:
    """File of a probe volume: an atlas (.exr), or ambient cubes for Bevy (.ktx2).

    name:   file name with extension
    grid:   light of the volume
    entry:  entry of the manifest for all files of the volume, without checksums
    group:  light group of an atlas; None for all light
    """

    name: str
    grid: ProbeGrid
    entry: dict
    group: str | None = None

    @property
    def is_first(self) -> bool:
        """True for the atlas of all light, the first file of a volume."""
        return self.name == self.entry["file"]

    def write(self, path: Path) -> None:
        """Write the file to a path; raises OSError or RuntimeError."""
        if self.name.endswith(_ATLAS):
            write_exr(path, probe_atlas(self.grid, self.group), PLAIN, is_colour=False)
        else:
            coefficients = windowed(self.grid.coefficients)
            path.write_bytes(ktx2_volume(bevy_voxels(coefficients, self.grid.resolution)))


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

    Each volume has an atlas, a texture, and an atlas for each light group, named after the .blend and the
    volume. A file of another program is never replaced; the new file gets a number instead.

    origin:  (3,) float64, world space: the point to which the grids are relative
    """
    if destination.folder is None:
        return []
    known, files = ObjectFiles(destination.folder, destination, SECTION, _checksums), list[ProbeFile]()
    for grid in grids:
        stem = known.stem(grid.name, "Probes", partial(_names, grid=grid))
        entry = _entry(stem, grid, origin, destination)
        files += [ProbeFile(f"{stem}{ending}", grid, entry) for ending in (_ATLAS, _TEXTURE)]
        files += [ProbeFile(file, grid, entry, group) for group, file in _group_files(stem, grid).items()]
    return files


def _names(stem: str, grid: ProbeGrid) -> list[str]:
    """Return the names of all files of a volume."""
    return [f"{stem}{_ATLAS}", f"{stem}{_TEXTURE}", *_group_files(stem, grid).values()]


def _group_files(stem: str, grid: ProbeGrid) -> dict[str, str]:
    """Return the file of each light group of a volume; names differ, ignoring case."""
    files: dict[str, str] = {}
    for group in grid.groups:
        base, taken = file_name(f"{stem}_{group}"), {file.casefold() for file in files.values()}
        numbered = (f"{name}{_ATLAS}" for name in numbered_names(base, len(grid.groups)))
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
    return made


def _checksums(entry: dict) -> dict[str, str]:
    """Return the checksums of the files of an entry, by file."""
    sums = {part.get("file", ""): part.get("sha256", "") for part in (entry, *entry.get("groups", ()))}
    return sums | {entry.get("ktx2", ""): entry.get("ktx2_sha256", "")}


def _entry(stem: str, grid: ProbeGrid, origin: np.ndarray, destination: Destination) -> dict:
    """Return the manifest entry of a volume, whose files have a stem."""
    matrix = grid.matrix.copy()
    matrix[:3, 3] += origin
    filled, moved = (int((grid.validity == value).sum()) for value in (0, 0.5))
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
    }
