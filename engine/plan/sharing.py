"""Choice of bakes that several GPUs of one machine share."""

from __future__ import annotations

from collections.abc import Callable

from ..device.cl_device import ComputeDevice
from ..device.peers import Peers
from ..patches.patch_scene import PatchScene
from ..settings import Settings
from ..visibility.rays.early_hits import EarlyHits
from ..visibility.rays.ray_sampler import RaySampler
from ..visibility.rays.ray_scene import RayScene
from ..visibility.sample_counts import ray_count

#: Minimum number of rays from all patches: the other devices need about 0.2 s to prepare, in which an H100
#: traces this number (measured).
_FEWEST_RAYS = 1 << 31

#: Minimum number of rays from patch groups that several devices share (chosen): one H200 traces 1.8 billion
#: in 0.32 s (measured), thus this number in 0.1 s.
_FEWEST_OF_GROUPS = 1 << 29


def share(
    rays: RayScene,
    patch_scene: PatchScene,
    open_peers: Callable[[], Peers] | None,
    settings: Settings,
    has_samples: bool,
) -> tuple[str, ...]:
    """Choose the other devices that share the work of a bake, none for a small one; return report sentences.

    The devices start to prepare and to trace.

    open_peers:   opens the other devices that the settings allow; None for none
    has_samples:  True if visibility of the last bake may be reused
    """
    rays.share_with(())
    rays.early = None
    if open_peers is None or settings.warm_start:
        return ()
    count = rays.count * ray_count(settings)
    if count < _FEWEST_RAYS:
        return (f"One device baked: {count:,} rays are too few to share; the minimum is {_FEWEST_RAYS:,}.",)
    peers = open_peers()
    rays.share_with(peers.opened)
    is_reused = has_samples and settings.patch_groups <= 1
    if peers.opened and not is_reused and _traces_early(rays, patch_scene, settings):

        def tracer(peer: ComputeDevice) -> RaySampler:
            return RaySampler(peer, rays.twin(peer), patch_scene, None, settings)

        rays.early = EarlyHits(rays.count, peers.opened, tracer, settings)
    return peers.notes


def _traces_early(rays: RayScene, patch_scene: PatchScene, settings: Settings) -> bool:
    """Return True if a later gather traces rays of all patches, so that other devices can trace them before.

    A hit stores the index of a texel, or `SKY`, 2^31 - 1, but no tint; see trace_hits.cl.
    """
    adaptive = settings.adaptive and rays.compute.processor
    on_one = settings.visibility == "raster" or settings.directional or settings.by_light_groups or adaptive
    fits = patch_scene.texel_to_patch.size < 1 << 31 and not patch_scene.cutouts.tinted
    return fits and not on_one


def rays_of_groups(rays: RayScene, groups: PatchScene, settings: Settings) -> RayScene:
    """Return rays from patch groups, shared by the devices that share `rays` if they are many.

    Light groups need the samples of all patch groups on one device.
    """
    many = len(groups.patches) * ray_count(settings) >= _FEWEST_OF_GROUPS
    return rays.shared_by(groups) if many and not settings.by_light_groups else rays.of(groups)


def shared_work(rays: RayScene) -> tuple[str, ...]:
    """Return a sentence for the report if other devices have traced rays of a bake."""
    return (f"{1 + len(rays.peers)} devices traced rays and gathered light.",) if rays.shared else ()
