"""Limits of drivers and devices, checked before anything large is allocated."""

from __future__ import annotations

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..errors import SettingsError
from ..scene.model import Scene
from ..settings import Settings
from ..visibility.raster.targets import MAX_PATCHES

#: Bytes for each texel of one atlas while its patches are listed: two RGBA32F targets, which the host copies.
_LIST_BYTES = 2 * 16

#: Bytes for each texel of every atlas: an index map entry, which the host copies, and the index of the
#: triangle that touches the texel.
_OWNER_BYTES, _TOUCHED_BYTES = 4, 4


def check_limits(
    graphics: GraphicsContext, compute: ComputeDevice | None, scene: Scene, settings: Settings
) -> None:
    """Raise SettingsError if the lightmaps are too large for the devices."""
    limits = graphics.context.info
    widest, layers = limits["GL_MAX_TEXTURE_SIZE"], limits["GL_MAX_ARRAY_TEXTURE_LAYERS"]
    if settings.resolution > widest:
        raise SettingsError(
            f"resolution is {settings.resolution}; '{graphics.name}' draws at most {widest} texels. Lower it."
        )
    if len(scene.atlases) > layers:
        raise SettingsError(
            f"The scene has {len(scene.atlases)} lightmaps, with internal ones; "
            f"'{graphics.name}' holds at most {layers}. "
            "Put objects into one lightmap: give them the same atlas name, or raise the resolution."
        )

    # Memory that grows with the lightmaps. Hemicubes are drawn in batches that fit. OpenGL reports no memory
    # size.
    if compute is None:
        return
    texels, atlases = settings.resolution**2, len(scene.atlases)
    needed = texels * (_LIST_BYTES + _OWNER_BYTES * atlases) + settings.batch_bytes
    if compute.device.host_unified_memory:
        needed += texels * (_LIST_BYTES + (_OWNER_BYTES + _TOUCHED_BYTES) * atlases)
    available = compute.device.global_mem_size
    if needed > available:
        raise SettingsError(
            f"{atlases} lightmaps of {settings.resolution} x {settings.resolution} texels need "
            f"{needed / 2**30:.1f} GiB; '{compute.name}' has {available / 2**30:.1f} GiB. "
            "Lower the resolution, or bake fewer objects at once."
        )


def check_patch_count(patches: int) -> None:
    """Raise SettingsError if there are more patches than the radiosity texture holds."""
    if patches > MAX_PATCHES:
        raise SettingsError(
            f"The lightmaps hold {patches:,} texels; at most {MAX_PATCHES:,} can be baked at once. "
            "Lower the resolution, or bake fewer objects at once."
        )
