"""Binary file of a patch list (paper, IV.A).

Layout, little-endian: magic, version, resolution, number of patches, CRC-32 of the charts, CRC-32 of the
body. The body holds the arrays atlas, texel, mesh, face and subface (int32 each), then barycentric (3
float32).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..device.device_rows import Rows
from ..errors import PatchFileError
from ..scene.model import Scene
from ..settings import Settings
from .patch_list import PatchList

_MAGIC = b"HEMIPATC"
_VERSION = 1
_HEADER = struct.Struct("<8sIIQII")

#: Bytes of each patch: five integers and three barycentrics.
_PATCH_BYTES = 4 * (5 + 3)

#: Tolerance of barycentrics outside of their triangle.
_BARYCENTRIC_TOLERANCE = 1e-3


def list_or_load_patches(
    scene: Scene, settings: Settings, make: Callable[[], tuple[PatchList, Rows | None]]
) -> tuple[PatchList, Rows | None]:
    """Read the patch list from `settings.patch_file`; without such a file create the list and write it there.

    Returns the patches, and the number of patches on each triangle if known. Raises PatchFileError if the
    file is unusable or cannot be written.

    make:  creates the list
    """
    if settings.patch_file is None:
        return make()
    path = Path(settings.patch_file)
    if path.exists():
        return read_patches(path, scene, settings.resolution, settings.align_uvs), None
    patches, counts = make()
    write_patches(path, scene, patches, settings.align_uvs)
    return patches, counts


def write_patches(path: Path, scene: Scene, patches: PatchList, align: bool = False) -> None:
    """Write the patch list of a scene; raises PatchFileError if the file cannot be written.

    The write is atomic: a temporary file next to it is renamed.
    """
    columns = (patches.atlas, patches.texel, *_faces(scene)[:, patches.triangle])
    body = b"".join(column.astype("<i4").tobytes() for column in columns)
    body += patches.barycentric.astype("<f4").tobytes()
    header = _HEADER.pack(
        _MAGIC, _VERSION, patches.resolution, len(patches), charts_checksum(scene, align), zlib.crc32(body)
    )
    partial = path.with_name(f"{path.name}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_bytes(header + body)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise PatchFileError(
            f"'{path}' cannot be written ({error.strerror}). Choose another path."
        ) from error


def read_patches(path: Path, scene: Scene, resolution: int, align: bool = False) -> PatchList:
    """Read the patch list of a scene from a file.

    Raises PatchFileError if the file cannot be read, has another format or version, or is damaged. Also
    raises it if the file belongs to other charts or another resolution, or contains patches outside the
    scene.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PatchFileError(f"'{path}' cannot be read ({error.strerror}). Choose another file.") from error
    if data[:8] != _MAGIC:
        raise PatchFileError(f"'{path}' is not a Hemibake patch file. Choose another file or bake again.")
    if len(data) < _HEADER.size:
        raise PatchFileError(f"'{path}' ends within its header. Delete it and bake again.")
    _, version, file_resolution, count, charts, checksum = _HEADER.unpack_from(data)
    body = data[_HEADER.size :]
    if version != _VERSION:
        raise PatchFileError(
            f"'{path}' has version {version}, this Hemibake reads version {_VERSION}. "
            "Delete it and bake again."
        )
    if len(body) != count * _PATCH_BYTES:
        raise PatchFileError(
            f"'{path}' should hold {count} patches in {count * _PATCH_BYTES} bytes but has {len(body)}. "
            "It is truncated or damaged: delete it and bake again."
        )
    if zlib.crc32(body) != checksum:
        raise PatchFileError(f"'{path}' is damaged: its checksum is wrong. Delete it and bake again.")
    if file_resolution != resolution or charts != charts_checksum(scene, align):
        raise PatchFileError(
            f"'{path}' was made for {file_resolution} x {file_resolution} texels of a scene whose lightmap "
            "UVs have changed or are aligned otherwise, or for another scene. Delete it and bake again."
        )
    integers = np.frombuffer(body, "<i4", 5 * count).astype(np.int32).reshape(5, count)
    barycentric = np.frombuffer(body, "<f4", 3 * count, 20 * count).astype(np.float32).reshape(count, 3)
    atlas, texel = integers[:2].copy()
    patches = PatchList(resolution, atlas, texel, _triangles_of(integers[2:], scene), barycentric)
    if not count or (_off_lightmaps(patches, scene) | _off_triangles(patches, scene)).any():
        raise PatchFileError(
            f"'{path}' has patches that are not in the scene, although its checksums are right. "
            "Delete it and bake again."
        )
    return patches


def charts_checksum(scene: Scene, align: bool = False) -> int:
    """Return a CRC-32 of the charts, faces and atlases on which a patch list depends.

    align:  True if UVs are snapped to texel borders
    """
    checksum = int(align)
    for mesh in scene.meshes:
        for values in (mesh.uvs, mesh.face, mesh.subface, np.array([mesh.atlas, len(mesh.face)], np.int32)):
            checksum = zlib.crc32(np.ascontiguousarray(values).tobytes(), checksum)
    return checksum


def _faces(scene: Scene) -> np.ndarray:
    """Return mesh, face and subface of each triangle, (3, t) int32: its identifier in the paper (IV.A)."""
    meshes = enumerate(scene.meshes)
    parts = [[np.full(len(mesh.face), index), mesh.face, mesh.subface] for index, mesh in meshes]
    return np.concatenate(parts, axis=1, dtype=np.int32)


def _triangles_of(faces: np.ndarray, scene: Scene) -> np.ndarray:
    """Return the triangle index of each mesh, face and subface, (3, n) int32; -1 for none.

    Uses binary search, since triangles are sorted by mesh, face and subface.
    """
    there = _faces(scene).astype(np.int64)
    sizes = there.max(axis=1) + 1
    code, codes = (
        (mesh * sizes[1] + face) * sizes[2] + subface
        for mesh, face, subface in (faces.astype(np.int64), there)
    )
    number = np.searchsorted(codes, code).clip(max=len(codes) - 1)
    within = ((faces >= 0) & (faces < sizes[:, None])).all(axis=0)
    triangles: np.ndarray = np.where(within & (codes[number] == code), number, -1).astype(np.int32)
    return triangles


def _off_lightmaps(patches: PatchList, scene: Scene) -> np.ndarray:
    """Return a mask of patches, (n,) bool, outside the texels of the atlases or out of texel order."""
    texels = patches.resolution**2
    wrong = (patches.atlas < 0) | (patches.atlas >= len(scene.atlases))
    wrong |= (patches.texel < 0) | (patches.texel >= texels)
    wrong[1:] |= np.diff(patches.atlas.astype(np.int64) * texels + patches.texel) <= 0
    return wrong


def _off_triangles(patches: PatchList, scene: Scene) -> np.ndarray:
    """Return a mask of patches, (n,) bool, without triangle, on a triangle of another atlas, or off it."""
    atlases = np.repeat([mesh.atlas for mesh in scene.meshes], [len(mesh.face) for mesh in scene.meshes])
    wrong = (patches.triangle < 0) | (atlases[patches.triangle] != patches.atlas)
    weights, slack = patches.barycentric, _BARYCENTRIC_TOLERANCE
    inside = (weights >= -slack).all(axis=1) & (np.abs(weights.sum(axis=1) - 1) <= slack)
    return wrong | ~inside
