"""Final lightmaps of all outputs: least-squares fit across seams, or plain dilation without it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..device.device_array import Values
from ..patches.seams import Seams
from .device_final_images import DeviceFinalImages
from .device_images import light_at
from .final_images import FinalImages
from .gutter_fill import GutterFill
from .lightmap_points import LightmapPoints
from .refined_texels import RefinedTexels


class FinalLightmaps:
    """Final lightmap images from values of texels: fit across seams, then fill.

    texels:      values of all texels
    off_centre:  indices and points of patches that are not at their texel's centre, see `off_centre_patches`
    seams:       pairs of points with equal light on both sides of UV seams; None to dilate without a fit
    """

    def __init__(
        self,
        texels: RefinedTexels,
        off_centre: tuple[np.ndarray, LightmapPoints] | None = None,
        seams: Seams | None = None,
    ) -> None:
        self._texels, self._compute = texels, texels.images.compute
        self._off_centre_texels = np.zeros(0, np.int64)
        self._maker: GutterFill | FinalImages | DeviceFinalImages
        if seams is None or off_centre is None:
            self._maker = texels.fill()
            return
        centres, points = self._light_points(*off_centre)
        where = centres, points, seams, texels.images.has_patch, texels.images.rings
        if self._compute is None:
            self._maker = FinalImages(*where)
        else:
            self._maker = DeviceFinalImages(self._compute, *where)

    def image(self, texels: np.ndarray) -> np.ndarray:
        """Return final images, (atlases, r, r, 3) float32, of texel values (`RefinedTexels.values`)."""
        if isinstance(self._maker, GutterFill):
            return self._maker.images(texels)
        return self._maker.images(texels, texels.reshape(-1, texels.shape[-1])[self._off_centre_texels])

    def images(
        self, patches: Mapping[str, Values], samples: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return the final images of outputs, by name.

        The texels need not leave the device, and several outputs are computed together.

        patches:  (n, 3) or (n,) float32 for each output, values of the patches
        samples:  (s, 3) or (s,) float32 for each output, values of the texel samples; empty if there are none
        """
        compute, maker = self._compute, self._maker
        if compute is None or isinstance(maker, FinalImages):
            return {
                name: self.image(self._texels.values(light, samples.get(name)))
                for name, light in patches.items()
            }
        names, images = list(patches), list[np.ndarray]()
        most = maker.device_images.most if isinstance(maker, GutterFill) else maker.most
        for first in range(0, len(names), most):
            together = names[first : first + most]
            shown = [self._texels.on_device(compute, patches[name], samples.get(name)) for name in together]
            if isinstance(maker, GutterFill):
                images.extend(maker.images_of(shown))
            else:
                images.extend(maker.images_of(shown, light_at(compute, shown, self._off_centre_texels)))
        return dict(zip(names, images, strict=True))

    def _light_points(self, patch: np.ndarray, points: LightmapPoints) -> tuple[np.ndarray, LightmapPoints]:
        """Return the texels with light at their centre, (atlases, r, r) bool, and the off-centre points."""
        images, centres = self._texels.images, self._texels.plain
        flat = centres.ravel()
        counts = patch < len(images.texel)
        counts[counts] = flat[images.texel[patch[counts]]]
        points = points.subset(counts)
        texels = points.texels(images.patches.resolution)
        order = np.argsort(texels, kind="stable")
        self._off_centre_texels = texels[order]
        flat[self._texels.supersampled] = True
        flat[self._off_centre_texels] = False
        return centres, points.subset(order)
