"""Limits of drivers and devices, checked before anything large is allocated."""

from __future__ import annotations

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..errors import SettingsError
from ..patches.patch_materials import PatchMaterials
from ..scene.model import Scene
from ..settings import Settings
from ..visibility.raster.targets import MAX_PATCHES
from ..visibility.rays.receiver_records import RECEIVER, TEXEL_STEP, uploaded_triangles

#: Bytes for each texel of one atlas while its patches are listed: two RGBA32F targets, which the host copies.
_LIST_BYTES = 2 * 16

#: Bytes for each texel of every atlas: an index map entry, which the host copies, and the index of the
#: triangle that touches the texel.
_OWNER_BYTES, _TOUCHED_BYTES = 4, 4

#: Bytes on the device for each triangle: UVs and a packet of the hierarchy. For each triangle that receivers
#: need (`uploaded_triangles`): corners, normals, texel steps. For each texel: the record of a receiver; if it
#: gathers, radiance, gathered and sampled light as float4.
_TRIANGLE_BYTES, _USED_BYTES = 24 + 48, 36 + 36 + TEXEL_STEP.dtype.itemsize
_RECEIVER_BYTES, _GATHER_BYTES = RECEIVER.dtype.itemsize, 3 * 16

#: Bytes on the host, which count on a CPU, for each triangle: scene without UVs, which a CPU reads in place;
#: positions, mesh and atlas of joined triangles; construction of the hierarchy beyond its packets. Measured
#: with 1 and 3 M triangles: the worker grows by 345 bytes a triangle in total. For each texel: its index,
#: triangle, barycentrics, position and normal.
_HOST_TRIANGLE_BYTES, _HOST_TEXEL_BYTES = 84 + 44 + 132, 20 + 12 + 12


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
    _check_memory(compute, sum(len(mesh.positions) for mesh in scene.meshes))
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


def may_gather(scene: Scene, surfaces: PatchMaterials, settings: Settings) -> bool:
    """Return False if no light can reach any patch and only light is an output, so that nothing gathers.

    surfaces:  surfaces of the patches
    """
    lit = bool(scene.lights) or bool(scene.world.any()) or len(surfaces.shining) > 0
    return lit or not settings.only_light


def check_patches(
    compute: ComputeDevice | None, triangles: int, used: int, patches: int, gathers: bool = True
) -> None:
    """Raise SettingsError if there are too many patches, or if the scene exceeds the memory of the device.

    used:     number of triangles with patches
    gathers:  False if no patch gathers light, see `may_gather`
    """
    if patches > MAX_PATCHES:
        raise SettingsError(
            f"The lightmaps hold {patches:,} texels; at most {MAX_PATCHES:,} can be baked at once. "
            "Lower the resolution, or bake fewer objects at once."
        )
    if compute is not None:
        _check_memory(compute, triangles, uploaded_triangles(triangles, used), patches, gathers)


def _check_memory(
    compute: ComputeDevice, triangles: int, uploaded: int = 0, patches: int = 0, gathers: bool = True
) -> None:
    """Raise SettingsError if triangles and patches alone exceed the memory of the device.

    The sum is a lower bound, so a scene that passes may still run out of memory.

    uploaded:  number of triangles that receivers need, see `uploaded_triangles`
    """
    needed = triangles * _TRIANGLE_BYTES + uploaded * _USED_BYTES
    needed += patches * (_RECEIVER_BYTES + gathers * _GATHER_BYTES)
    if compute.processor:
        needed += triangles * _HOST_TRIANGLE_BYTES + patches * _HOST_TEXEL_BYTES
    available = compute.device.global_mem_size
    if needed > available:
        texels = f" and {patches:,} texels" if patches else ""
        raise SettingsError(
            f"{triangles:,} triangles{texels} need at least {needed / 2**30:.1f} GiB; '{compute.name}' has "
            f"{available / 2**30:.1f} GiB. Lower the resolution, simplify dense meshes, or set the role of "
            "objects to Ignored."
        )
