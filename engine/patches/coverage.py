"""Which texels triangles touch: to find overlapping charts, and surfaces that cover no texel's centre."""

from __future__ import annotations

import moderngl
import numpy as np

from ..device.graphics import Graphics
from ..errors import OverlapError
from ..naming import naming
from ..scene.model import Scene
from ..scene.triangles import Triangles
from .patch_list import PatchList

#: Charts overlap if more than this fraction of an object's texels is covered twice.
_OVERLAP_TOLERANCE = 0.005


def touched_triangles(graphics: Graphics, triangles: Triangles, atlases: int, resolution: int) -> np.ndarray:
    """Return the triangle that touches each texel, nearest to its centre, or -1.

    Returns (atlases, resolution, resolution) int32, index into `Triangles`.
    """
    touched = np.full((atlases, resolution, resolution), -1, np.int32)
    for atlas in range(atlases):
        chosen = np.flatnonzero(triangles.atlas == atlas)
        image = _draw(graphics, "touched", triangles.uvs[chosen], resolution, "u4")[..., 0].view(np.uint32)
        touched[atlas] = np.concatenate([[-1], chosen]).astype(np.int32)[image]
    return touched


def note_uncovered(scene: Scene, patches: PatchList) -> list[str]:
    """Return a warning that names the objects whose UVs cover no texel's centre."""
    texels = np.bincount(patches.mesh, minlength=len(scene.meshes))
    names = [
        mesh.name for mesh, count in zip(scene.meshes, texels, strict=True) if not count and len(mesh.face)
    ]
    if not names:
        return []
    sentence = (
        "The lightmap UVs of {} are too small to cover a texel: their light is a guess. "
        "Unwrap them again or raise the resolution."
    )
    return [naming(sentence, names)]


def check_overlap(graphics: Graphics, scene: Scene, triangles: Triangles, patches: PatchList) -> list[str]:
    """Return a warning for each object a few of whose texels are covered by several triangles.

    Raises OverlapError, naming the objects, if charts truly overlap.
    """
    counts = []
    for atlas in range(len(scene.atlases)):
        uvs = triangles.uvs[triangles.atlas == atlas]
        image = _draw(graphics, "overlap", uvs, patches.resolution, "f4")
        counts.append(image.view(np.float32)[..., 0].ravel()[patches.texel[patches.atlas == atlas]])
    twice = np.concatenate(counts) > 1.5

    # Fractions of each object's texels; rounding at common chart borders doubles a few texels at most.
    total = np.bincount(patches.mesh, minlength=len(scene.meshes))
    doubled = np.bincount(patches.mesh[twice], minlength=len(scene.meshes))
    bad = doubled > np.maximum(_OVERLAP_TOLERANCE * total, 2)
    if bad.any():
        raise OverlapError(
            _overlap_message(scene, triangles, patches, np.flatnonzero(twice & bad[patches.mesh]))
        )
    return [
        f"Object '{scene.meshes[mesh].name}': {doubled[mesh]} lightmap texels are covered twice."
        for mesh in np.flatnonzero(doubled)
    ]


def _draw(graphics: Graphics, kind: str, uvs: np.ndarray, resolution: int, dtype: str) -> np.ndarray:
    """Draw triangles into one lightmap-sized target; return (resolution, resolution, 1) of its bits."""
    context = graphics.context
    if not len(uvs):
        return np.zeros((resolution, resolution, 1), np.uint32)
    target = context.texture((resolution, resolution), 1, dtype=dtype)
    depth = context.depth_renderbuffer((resolution, resolution))
    framebuffer = context.framebuffer([target], depth)
    stages = ("vert", "geom", "frag") if kind == "touched" else ("vert", "frag")
    program = graphics.program(kind, stages)
    if kind == "touched":
        program["resolution"] = float(resolution)
    buffer = context.buffer(np.ascontiguousarray(uvs, np.float32).tobytes())
    vertices = context.vertex_array(program, [(buffer, "2f", "in_uv")])

    # Triangles either compete by depth for a texel, or are added up.
    framebuffer.use()
    framebuffer.clear(depth=1.0)
    _blend(context, kind == "overlap")
    vertices.render(moderngl.TRIANGLES)
    _blend(context, False)
    image = np.frombuffer(target.read(), np.uint32).reshape(resolution, resolution, 1)
    graphics.check("drawing lightmap UVs")
    graphics.discard(vertices, buffer, framebuffer, depth, target)
    return image


def _blend(context: moderngl.Context, adding: bool) -> None:
    """Switch between adding fragments up and letting the nearest win."""
    context.disable(moderngl.CULL_FACE)
    context.depth_func = "<"
    context.blend_func = moderngl.ONE, moderngl.ONE
    (context.enable_only if adding else context.disable)(moderngl.BLEND)
    (context.disable if adding else context.enable)(moderngl.DEPTH_TEST)


def _overlap_message(scene: Scene, triangles: Triangles, patches: PatchList, doubled: np.ndarray) -> str:
    """Name the objects that meet in a sample of the doubled texels."""
    sample = doubled[:: max(1, len(doubled) // 64)]
    meshes = {int(mesh) for patch in sample for mesh in _meshes_at(triangles, patches, int(patch))}
    names = [scene.meshes[mesh].name for mesh in sorted(meshes)]
    atlas = scene.atlases[int(patches.atlas[sample[0]])]
    fraction = len(doubled) / max(1, int(np.isin(patches.mesh, list(meshes)).sum()))
    sentence = (
        f"Lightmap UVs overlap in atlas '{atlas}' ({fraction:.0%} of the texels of {{}}). "
        "Unwrap or pack them without overlaps, or give the objects atlases of their own."
    )
    return naming(sentence, names)


def _meshes_at(triangles: Triangles, patches: PatchList, patch: int) -> np.ndarray:
    """Return the meshes of all triangles that cover a patch's texel centre."""
    resolution = patches.resolution
    texel = int(patches.texel[patch])
    center = (np.array([texel % resolution, texel // resolution]) + 0.5) / resolution
    uvs = triangles.uvs[triangles.atlas == patches.atlas[patch]].astype(np.float64)
    from_center = uvs - center
    to_next = np.roll(uvs, -1, axis=1) - uvs
    side = from_center[..., 0] * to_next[..., 1] - from_center[..., 1] * to_next[..., 0]
    inside = (side >= 0).all(axis=1) | (side <= 0).all(axis=1)
    return np.unique(triangles.mesh[triangles.atlas == patches.atlas[patch]][inside])
