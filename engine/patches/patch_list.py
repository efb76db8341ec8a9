"""The patch list: which texels of the lightmaps lie on a surface, and where (paper, III.A and IV.A)."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from ..device.graphics import Graphics
from ..errors import SceneError
from ..scene.model import Mesh, Scene

#: By how much drawn barycentrics may miss a sum of 1.
_SUM = 1e-6

#: The arrays of a patch list, one entry a patch.
_COLUMNS = ("atlas", "texel", "mesh", "face", "subface", "barycentric")


@dataclass(frozen=True)
class PatchList:
    """The paper's five data of each patch, and the lightmap it lies in; ordered by atlas, then texel.

    atlas        (n,) int32
    texel        (n,) int32, row * resolution + column, row 0 at v = 0
    mesh         (n,) int32, index into `Scene.meshes`
    face         (n,) int32, polygon within the mesh
    subface      (n,) int32, triangle within the polygon
    barycentric  (n, 3) float32, of the texel's centre within the triangle; each in [0, 1], sum 1
    """

    resolution: int
    atlas: np.ndarray
    texel: np.ndarray
    mesh: np.ndarray
    face: np.ndarray
    subface: np.ndarray
    barycentric: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    def part(self, chosen: np.ndarray) -> PatchList:
        """Return some patches, by a mask or their numbers."""
        return PatchList(self.resolution, **{name: getattr(self, name)[chosen] for name in _COLUMNS})


def list_patches(graphics: Graphics, scene: Scene, resolution: int) -> PatchList:
    """Rasterise the lightmap UVs of every atlas and compact the covered texels.

    Raises SceneError if no texel centre is covered.
    """
    patches = [
        _compact(atlas, resolution, *_rasterise_atlas(graphics, scene, atlas, resolution))
        for atlas in range(len(scene.atlases))
    ]
    if not any(len(part) for part in patches):
        names = ", ".join(f"'{mesh.name}'" for mesh in scene.meshes[:5])
        raise SceneError(
            f"No texel of a {resolution} x {resolution} lightmap lies on a surface: "
            f"the lightmap UVs of {names} are too small or have no area. "
            "Unwrap them again or raise the resolution."
        )
    return concatenate(patches)


def concatenate(parts: list[PatchList]) -> PatchList:
    """Join patch lists of one resolution, in order."""
    if len(parts) == 1:
        return parts[0]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
    return PatchList(parts[0].resolution, **joined)


def _rasterise_atlas(
    graphics: Graphics, scene: Scene, atlas: int, resolution: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the two floating-point RGBA targets of one atlas; return both as (r, r, 4) float32."""
    context = graphics.context
    corners = [
        _corner_attributes(index, mesh) for index, mesh in enumerate(scene.meshes) if mesh.atlas == atlas
    ]
    data = np.concatenate([*corners, np.zeros((0, 8), np.float32)])
    if not len(data):
        return np.zeros((resolution, resolution, 4), np.float32), np.zeros(
            (resolution, resolution, 4), np.float32
        )

    # Two render targets: barycentric coordinate and flag, indices and flag.
    targets = [context.texture((resolution, resolution), 4, dtype="f4") for _ in range(2)]
    framebuffer = context.framebuffer(targets)
    program = graphics.program("patches", ("vert", "frag"))
    buffer = context.buffer(data.tobytes())
    vertices = context.vertex_array(program, [(buffer, "2f 3f 3f", "in_uv", "in_identity", "in_corner")])
    framebuffer.use()
    framebuffer.clear()
    context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    vertices.render(moderngl.TRIANGLES)

    # Back to the host.
    images = [
        np.frombuffer(target.read(), np.float32).reshape(resolution, resolution, 4) for target in targets
    ]
    graphics.check("drawing the patch list")
    graphics.discard(vertices, buffer, framebuffer, *targets)
    return images[0], images[1]


def _corner_attributes(index: int, mesh: Mesh) -> np.ndarray:
    """Return (3 t, 8) float32: uv, (mesh, face, subface), barycentric coordinate of the corner."""
    count = len(mesh.positions)
    identity = np.stack([np.full(count, index), mesh.face, mesh.subface], axis=1)
    data = np.empty((count, 3, 8), np.float32)
    data[:, :, 0:2] = mesh.uvs
    data[:, :, 2:5] = identity[:, None]
    data[:, :, 5:8] = np.eye(3)
    return data.reshape(-1, 8)


def _compact(atlas: int, resolution: int, barycentric: np.ndarray, identity: np.ndarray) -> PatchList:
    """Keep the texels whose flag is set."""
    flagged = (barycentric[..., 3] != 0).ravel()
    texel = np.flatnonzero(flagged).astype(np.int32)
    mesh, face, subface, _ = identity.reshape(-1, 4).compress(flagged, axis=0).T.astype(np.int32, order="C")
    place = _on_triangle(barycentric.reshape(-1, 4).compress(flagged, axis=0)[:, :3])
    return PatchList(resolution, np.full(len(texel), atlas, np.int32), texel, mesh, face, subface, place)


def _on_triangle(barycentric: np.ndarray) -> np.ndarray:
    """Return barycentrics, (n, 3), that lie on their triangles: those drawn on slivers do not, or are NaN."""
    placed = np.ascontiguousarray(barycentric)
    first, second, last = placed.T
    least = np.minimum(np.minimum(first, second), last)
    off = np.flatnonzero(~((least >= 0) & (np.abs(first + second + last - 1) <= _SUM)))
    inside = np.clip(np.nan_to_num(placed[off]), 0, 1)
    total = inside.sum(axis=1, keepdims=True)
    third = np.float32(1 / 3)
    placed[off] = np.divide(inside, total, out=np.full_like(inside, third), where=total > 0)
    return placed
