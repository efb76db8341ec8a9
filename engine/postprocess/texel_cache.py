"""Cache of texel data that does not depend on light: patch areas, seams, clipped triangles, images."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from ..device.cl_device import ComputeDevice
from ..patches.areas import surface_areas
from ..patches.device_edge_neighbours import DeviceNeighbours
from ..patches.patch_list import PatchList
from ..patches.patch_scene import PatchScene
from ..patches.seams import Seams
from ..patches.texel_fragments import TexelClipper
from ..scene.memo import Memo
from ..settings import Settings
from .lightmap_points import LightmapPoints, off_centre_patches
from .seam_lookups import display_seams
from .store import LightmapImages


class TexelCache:
    """Texel data of the last bake, reused while geometry and lightmap UVs are unchanged."""

    def __init__(self) -> None:
        self._areas, self._seams = Memo[Future[np.ndarray]](), Memo[Future[Seams]]()
        self._clipper, self._off_centre = Memo[TexelClipper](), Memo[tuple[np.ndarray, LightmapPoints]]()
        self._images: LightmapImages | None = None

    def clear(self) -> None:
        """Drop all data except the images, which `images` replaces if the patches differ."""
        for memo in (self._areas, self._seams, self._clipper, self._off_centre):
            memo.clear()

    def begin(
        self, compute: ComputeDevice | None, patch_scene: PatchScene, atlases: int, settings: Settings
    ) -> tuple[Future[np.ndarray], Future[Seams] | None]:
        """Start to compute the area of each patch in a background thread; return the futures.

        The thread then computes the seams of the first `atlases` lightmaps if the settings request them. They
        are needed last, and two threads would slow each other down.
        """
        thread, seams = ThreadPoolExecutor(1, "texels"), None
        areas = self._areas.get(
            (),
            lambda: thread.submit(
                surface_areas, patch_scene.triangles, patch_scene.patches, patch_scene.geometry
            ),
        )
        if settings.hide_seams:
            neighbours, resolution = (
                DeviceNeighbours(compute) if compute else None,
                patch_scene.patches.resolution,
            )
            seams = self._seams.get(
                (),
                lambda: thread.submit(display_seams, patch_scene.triangles, atlases, resolution, neighbours),
            )
        thread.shutdown(wait=False)
        return areas, seams

    def prepare(
        self, compute: ComputeDevice, patch_scene: PatchScene, atlases: int, settings: Settings
    ) -> None:
        """Compute the data of the first `atlases` lightmaps that does not depend on light."""
        if settings.texel_samples > 1:
            self.clipper(compute, patch_scene).rows(atlases)
        if settings.hide_seams:
            self.off_centre_patches(compute, patch_scene)

    def off_centre_patches(
        self, compute: ComputeDevice | None, patch_scene: PatchScene
    ) -> tuple[np.ndarray, LightmapPoints]:
        """Return the indices, (k,) int64, and points of the patches that are not at their texel's centre."""
        return self._off_centre.get(
            (), lambda: off_centre_patches(compute, patch_scene.triangles, patch_scene.patches)
        )

    def clipper(self, compute: ComputeDevice, patch_scene: PatchScene) -> TexelClipper:
        """Return the clipper of triangles at texel borders."""
        return self._clipper.get(
            (), lambda: TexelClipper(compute, patch_scene.triangles, patch_scene.patches.resolution)
        )

    def images(
        self, patches: PatchList, atlases: int, settings: Settings, compute: ComputeDevice | None
    ) -> LightmapImages:
        """Return the lightmap images, reused if the texels are the same.

        Only a warm start keeps the invalid patches and the fill.
        """
        if self._images is not None and self._images.fits(patches, atlases, settings.margin):
            if not settings.warm_start:
                self._images.show_all()
        else:
            self._images = LightmapImages(patches, atlases, settings.margin, compute)
        return self._images

    def release_fill(self) -> None:
        """Drop the fill of the images."""
        if self._images is not None:
            self._images.release()
