"""Lightmap images from patch values and texel samples: scatter, fit across seams, fill of unknown texels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.device_array import Values
from ..direct.contact import Contacts
from ..patches.patch_list import PatchList
from ..patches.seams import Seams
from ..scene.digests import same_values
from ..validity.invalid import is_invalid
from .device_fill import DeviceFill
from .device_final_images import DeviceFinalImages
from .device_images import DeviceImages, DevicePatches, DeviceTexels, light_at, texels_of
from .dilation import Dilation
from .final_images import FinalImages
from .lightmap_points import LightmapPoints
from .texel_means import TexelMeans
from .thin_wall_fit import ThinWallFit


class LightmapImages:
    """Conversion of patch values into the lightmap images of all atlases of the user.

    Patches of objects without lightmap lie in further atlases, which are left out.

    has_patch   (atlases, r, r) bool, texels that are patches
    keeps_fill  True if the fill is kept for the next image with the same known texels
    """

    def __init__(
        self, patches: PatchList, atlases: int, dilation: int, compute: ComputeDevice | None = None
    ) -> None:
        self._patches, self._chosen = patches, slice(patches.count_in(atlases))
        self._texel = patches.key[self._chosen]
        self._rings, self._compute = dilation, compute
        self._device: DevicePatches | None = None
        self._dilations: list[Dilation] = []
        self._gutters: DeviceImages | None = None
        self._filled_last: tuple[np.ndarray, DeviceImages] | None = None
        self.keeps_fill = False
        self._hidden, self._hidden_texels = np.zeros(len(self._texel), bool), self._texel[:0]
        self._dark = np.zeros(len(patches), bool)
        self.reset()
        on_texels = patches.on_texels(atlases)
        self.has_patch, self._entry = on_texels > 0, on_texels.ravel().copy()

    def suits(self, patches: PatchList, atlases: int, dilation: int) -> bool:
        """Return True if patches, number of atlases and margin in texels are the same."""
        same = self._patches.resolution == patches.resolution and len(self.has_patch) == atlases
        return same and self._rings == dilation and same_values(self._patches.key, patches.key)

    def reset(self) -> None:
        """Return to texels with one sample at their centre and without seams."""
        self._fit: FinalImages | DeviceFinalImages | None = None
        self._walls: ThinWallFit | None = None
        self._means: TexelMeans | None = None
        self._thin_texels = self._texel[:0]
        self._dilations, self._gutters = [], None

    def show_all(self) -> None:
        """Treat all patches as valid until `hide` is called."""
        self._show_but(np.zeros(len(self._patches), bool))
        self._fill(self._dark)

    def hide(self, front: np.ndarray, near: Contacts) -> None:
        """Set the invalid patches, whose texels are filled.

        Replaces the previous set, since objects may move.

        front  (n,) float32, validity: fraction of the hemisphere without back faces; patches inside closed
               objects have low values
        near   contacts of the patches; a covered patch is black whatever its rays hit
        """
        self._show_but(near.hide)
        self._fill(is_invalid(front, near))

    def _show_but(self, dark: np.ndarray) -> None:
        """Show the patches except dark ones, (n,) bool."""
        if not same_values(dark, self._dark):
            before, now = (np.flatnonzero(flags[self._chosen]) for flags in (self._dark, dark))
            self._entry[self._texel[before]] = before + 1
            self._entry[self._texel[now]] = 0
            self._device, self._dark = None, dark

    def _fill(self, hidden: np.ndarray) -> None:
        """Set the patches, (n,) bool, whose texels are filled."""
        hidden = hidden[self._chosen]
        if not np.array_equal(hidden, self._hidden):
            self._hidden, self._hidden_texels = hidden, self._texel[hidden]
            self._dilations, self._gutters = [], None

    def image(self, values: Values) -> np.ndarray:
        """Return patch values, (n, 3) or (n,), as images, (atlases, r, r, 3) float32, 0 elsewhere."""
        return _coloured(self._scattered(values))

    @property
    def no_image(self) -> np.ndarray:
        """Image of no atlas, (0, r, r, 3) float32."""
        return np.zeros((0, *self.has_patch.shape[1:], 3), np.float32)

    def display(self, values: Values) -> np.ndarray:
        """Return patch values as images with invalid texels filled and charts dilated."""
        if self._compute is None:
            return self._dilated(self.image(values))
        image: np.ndarray = self._filled(self._compute, [self._on_patches(self._compute, values, None)])[0]
        return image

    def refine(self, means: TexelMeans, hidden: np.ndarray) -> None:
        """Use the means of texel samples.

        means   supersampled texels
        hidden  (n,) bool, invalid patches
        """
        self._fill(hidden)
        self._means, self._dilations, self._gutters = means, [], None

    def part(self, walls: ThinWallFit | None) -> None:
        """Use the separate fit of texels at thin walls."""
        self._walls = walls

    def hide_seams(self, thin: tuple[np.ndarray, LightmapPoints], seams: Seams) -> None:
        """Use the least-squares fit, which makes both sides of UV seams equal, for `final` images.

        thin  patches that are not at their texel's centre, see `off_centre_patches`
        """
        centres, beside = self._light_points(*thin)
        where = centres, beside, seams, self.has_patch, self._rings
        self._fit = FinalImages(*where) if self._compute is None else DeviceFinalImages(self._compute, *where)

    def texels(self, values: Values, samples: np.ndarray | None) -> np.ndarray:
        """Return the value of each texel before the fit, (atlases, r, r, 3) or (atlases, r, r, 1) float32.

        values   (n, 3) or (n,) float32, values of the patches
        samples  (s, 3) or (s,) float32, values of the texel samples; None if there are none
        """
        images = self._scattered(values)
        if samples is not None and self._means is not None:
            texels = images.reshape(-1, images.shape[-1])
            texels[self._means.shown] = self._means.of(samples)
            if self._walls is not None:
                texels[self._walls.texels] = self._walls.light(samples, texels[self._walls.centres])
        return images

    def texels_on_device(self, values: Values, samples: np.ndarray | None) -> DeviceTexels:
        """Return the same on the device; raise AssertionError without one."""
        assert self._compute is not None
        return self._on_patches(self._compute, values, samples)

    def final(self, texels: np.ndarray) -> np.ndarray:
        """Return the final images from the result of `texels`; see `hide_seams`."""
        if self._fit is None:
            return _coloured(self._dilated(texels))
        return self._fit.images(texels, texels.reshape(-1, texels.shape[-1])[self._thin_texels])

    def finished(
        self, values: Mapping[str, Values], samples: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return the final images of outputs, by name, like `final` of `texels`.

        The texels need not leave the device, and several outputs are computed together.

        values   (n, 3) or (n,) float32 for each output, values of the patches
        samples  (s, 3) or (s,) float32 for each output, values of the texel samples; empty if there are none
        """
        compute = self._compute
        if compute is None:
            return {name: self.final(self.texels(light, samples.get(name))) for name, light in values.items()}
        names, images, most = list(values), list[np.ndarray](), self._filling(compute).most
        for first in range(0, len(names), most):
            together = names[first : first + most]
            shown = [self._on_patches(compute, values[name], samples.get(name)) for name in together]
            if isinstance(self._fit, DeviceFinalImages):
                images.extend(self._fit.images_of(shown, light_at(compute, shown, self._thin_texels)))
            else:
                images.extend(self._filled(compute, shown))
        return dict(zip(names, images, strict=True))

    @property
    def hidden(self) -> np.ndarray:
        """Invalid patches, a mask of the patches on the user's lightmaps, (m,) bool."""
        return self._hidden

    @property
    def known(self) -> np.ndarray:
        """Texels with valid light, (atlases, r, r) bool; all others are filled."""
        known = self.has_patch.copy()
        known.ravel()[self._hidden_texels] = False
        if self._means is not None:
            known.ravel()[self._means.hidden] = False
            known.ravel()[self._means.texels] = True
        return known

    @property
    def centres(self) -> np.ndarray:
        """Texels with one sample at their centre, (atlases, r, r) bool."""
        centres = self.known
        if self._means is not None:
            centres.ravel()[self._means.shown] = False
        return centres

    @property
    def _plain(self) -> np.ndarray:
        """Texels of valid patches without texel samples, (atlases * r * r,) bool."""
        plain = self.has_patch.flatten()
        plain[self._hidden_texels] = False
        if self._means is not None:
            plain[self._means.texels] = plain[self._means.hidden] = False
        return plain

    def _light_points(self, thin: np.ndarray, points: LightmapPoints) -> tuple[np.ndarray, LightmapPoints]:
        """Return the texels with light at their centre, (atlases, r, r) bool, and the off-centre points."""
        centres = self._plain
        counts = thin < len(self._texel)
        counts[counts] = centres[self._texel[thin[counts]]]
        points = points.part(counts)
        texels = points.texels(self._patches.resolution)
        order = np.argsort(texels, kind="stable")
        self._thin_texels = texels[order]
        if self._means is not None:
            centres[self._means.shown] = True
        centres[self._thin_texels] = False
        return centres.reshape(self.has_patch.shape), points.part(order)

    def _scattered(self, values: Values) -> np.ndarray:
        """Return patch values, (n, 3) or (n,), as images, (atlases, r, r, 3 or 1) float32, 0 elsewhere."""
        if self._compute is not None:
            return self._on_device(self._compute).images(_rows(values))
        channels = np.asarray(_rows(values))
        image = np.take(channels, self._entry.astype(np.int64) - 1, axis=0, mode="clip")
        image[self._entry == 0] = 0
        return image.reshape(*self.has_patch.shape, channels.shape[1])

    def _dilated(self, images: np.ndarray) -> np.ndarray:
        """Return images with invalid texels filled and charts dilated."""
        if self._compute is not None:
            dilated: np.ndarray = self._filled(self._compute, [texels_of(self._compute, images)])[0]
            return dilated
        if not self._dilations:
            self._dilations = [Dilation(mask, self._rings) for mask in self.known]
        filled = images.copy()
        for dilation, image in zip(self._dilations, filled, strict=True):
            dilation.fill(image)
        return filled

    def _on_device(self, compute: ComputeDevice) -> DevicePatches:
        """Return the map from patches to texels on the device, created on first use."""
        if self._device is None:
            self._device = DevicePatches(compute, self._entry.reshape(self.has_patch.shape))
        return self._device

    def _on_patches(self, compute: ComputeDevice, values: Values, samples: np.ndarray | None) -> DeviceTexels:
        """Return the value of each texel before the fit, on the device."""
        texels = self._on_device(compute).texels(_rows(values))
        if samples is not None and self._means is not None:
            self._means.show(texels, samples)
            if self._walls is not None:
                texels.put_rows(
                    self._walls.texels, self._walls.light(samples, texels.rows(self._walls.centres))
                )
        return texels

    def _filling(self, compute: ComputeDevice) -> DeviceImages | DeviceFinalImages:
        """Return the object that makes the final images."""
        return self._fit if isinstance(self._fit, DeviceFinalImages) else self._plain_fill(compute)

    def _plain_fill(self, compute: ComputeDevice) -> DeviceImages:
        """Return the fill of invalid texels and gutters, created on first use."""
        if self._gutters is None:
            known, last = self.known, self._filled_last
            if last is None or not np.array_equal(last[0], known):
                fill = DeviceFill(compute, known, known, np.zeros_like(known), self._rings, self._rings)
                last = known, DeviceImages(compute, known, fill)
            self._filled_last, self._gutters = last if self.keeps_fill else None, last[1]
        return self._gutters

    def _filled(self, compute: ComputeDevice, outputs: Sequence[DeviceTexels]) -> np.ndarray:
        """Return texels as images with invalid texels filled and charts dilated.

        (outputs, atlases, r, r, 3) float32
        """
        gutters = self._plain_fill(compute)
        gutters.load(outputs)
        return gutters.filled()


def _rows(values: Values) -> Values:
    """Return values, (n, c) or (n,), with shape (n, c), without a copy if possible."""
    return values[:, None] if isinstance(values, np.ndarray) and values.ndim == 1 else values


def _coloured(images: np.ndarray) -> np.ndarray:
    """Return images with one or three channels, (..., c), with three, (..., 3)."""
    return images if images.shape[-1] == 3 else np.repeat(images, 3, axis=-1)
