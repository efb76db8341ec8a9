"""Lightmap images from patch values: scatter into texels, and fill of invalid texels and gutters."""

from __future__ import annotations

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.device_array import Values
from ..direct.contact import Contacts
from ..patches.patch_list import PatchList
from ..scene.digests import same_values
from ..validity.invalid import is_invalid
from .device_images import DevicePatches, DeviceTexels
from .gutter_fill import GutterFill


class LightmapImages:
    """Conversion of patch values into lightmap images, for all atlases of the user.

    Patches of objects without lightmap lie in further atlases, which are left out.

    patches:    patches of all atlases
    compute:    OpenCL device; None to use the host
    rings:      distance by which charts are extended, texels
    has_patch:  (atlases, r, r) bool, texels that are patches
    invalid:    (m,) bool, invalid patches of the user's atlases, whose texels are filled
    """

    def __init__(
        self, patches: PatchList, atlases: int, rings: int, compute: ComputeDevice | None = None
    ) -> None:
        self.patches, self._chosen = patches, slice(patches.count_in(atlases))
        self.texel = patches.key[self._chosen]
        self.rings, self.compute = rings, compute
        self._device: DevicePatches | None = None
        self._fill: GutterFill | None = None
        self.invalid = np.zeros(len(self.texel), bool)
        self._dark = np.zeros(len(patches), bool)
        on_texels = patches.on_texels(atlases)
        self.has_patch, self._entry = on_texels > 0, on_texels.ravel()

    def fits(self, patches: PatchList, atlases: int, rings: int) -> bool:
        """Return True if these images fit the given patches, number of atlases and margin in texels."""
        same = self.patches.resolution == patches.resolution and len(self.has_patch) == atlases
        return same and self.rings == rings and same_values(self.patches.key, patches.key)

    def release(self) -> None:
        """Drop the fill, which holds arrays of all texels."""
        self._fill = None

    def show_all(self) -> None:
        """Treat all patches as valid until `hide` is called."""
        none = np.zeros(len(self.patches), bool)
        self._set_dark(none)
        self._set_invalid(none)

    def hide(self, validity: np.ndarray, contacts: Contacts) -> None:
        """Set the invalid patches, whose texels are filled.

        Replaces the previous set, since objects may move.

        validity:  (n,) float32, fraction of the hemisphere without back faces; patches inside
                   closed objects have low values
        contacts:  contacts of the patches; a covered patch is black whatever its rays hit
        """
        self._set_dark(contacts.covered)
        self._set_invalid(is_invalid(validity, contacts))

    def _set_dark(self, dark: np.ndarray) -> None:
        """Remove patches that are covered by a touching face, (n,) bool, from the images."""
        if not same_values(dark, self._dark):
            before, now = (np.flatnonzero(flags[self._chosen]) for flags in (self._dark, dark))
            if not self._entry.flags.writeable:
                # Most bakes have no dark patches, and share the array of the patch list.
                self._entry = self._entry.copy()
            self._entry[self.texel[before]] = before + 1
            self._entry[self.texel[now]] = 0
            self._device, self._dark = None, dark

    def _set_invalid(self, invalid: np.ndarray) -> None:
        """Set the invalid patches, (n,) bool; the fill replaces the values of their texels."""
        invalid = invalid[self._chosen]
        if not np.array_equal(invalid, self.invalid):
            self.invalid, self._fill = invalid, None

    @property
    def valid_texels(self) -> np.ndarray:
        """Texels of valid patches, (atlases, r, r) bool."""
        valid = self.has_patch.copy()
        valid.ravel()[self.texel[self.invalid]] = False
        return valid

    @property
    def fill(self) -> GutterFill:
        """Fill of the texels that have no valid patch, created on first use."""
        if self._fill is None:
            self._fill = GutterFill(self.compute, self.valid_texels, self.rings)
        return self._fill

    def image(self, values: Values) -> np.ndarray:
        """Scatter patch values, (n, 3) or (n,), into images, (atlases, r, r, 3) float32."""
        images = self.scattered(values)
        return images if images.shape[-1] == 3 else np.repeat(images, 3, axis=-1)

    @property
    def no_image(self) -> np.ndarray:
        """Placeholder for outputs without an image: no atlas, (0, r, r, 3) float32."""
        return np.zeros((0, *self.has_patch.shape[1:], 3), np.float32)

    def display(self, values: Values) -> np.ndarray:
        """Return images for display during a bake: patch values, filled texels, dilated charts.

        The host computes them while the programs of a CPU are built, so that the first light needs fewer.
        """
        if self.compute is None:
            return self.fill.images(self.image(values))
        if self.compute.is_preparing and isinstance(values, np.ndarray):
            return GutterFill(None, self.valid_texels, self.rings).images(self._on_host(values))
        image: np.ndarray = self.fill.images_of([self.on_device(self.compute, values)])[0]
        return image

    def scattered(self, values: Values) -> np.ndarray:
        """Scatter patch values, (n, 3) or (n,), into images, (atlases, r, r, 3 or 1) float32."""
        if self.compute is not None:
            return self._patches_on(self.compute).images(_rows(values))
        return self._on_host(values)

    def _on_host(self, values: Values) -> np.ndarray:
        """Scatter patch values on the host, with shapes as in `scattered`."""
        channels = np.asarray(_rows(values))
        image = np.take(channels, self._entry.astype(np.int64) - 1, axis=0, mode="clip")
        image[self._entry == 0] = 0
        return image.reshape(*self.has_patch.shape, channels.shape[1])

    def on_device(self, compute: ComputeDevice, values: Values) -> DeviceTexels:
        """Scatter patch values, (n, 3) or (n,), into texels on the OpenCL device."""
        return self._patches_on(compute).texels(_rows(values))

    def _patches_on(self, compute: ComputeDevice) -> DevicePatches:
        """Return the map from patches to texels on the device, created on first use."""
        if self._device is None:
            entries = self.patches.on_texels(len(self.has_patch))
            changed = self._entry.flags.writeable
            self._device = DevicePatches(compute, self._entry.reshape(entries.shape) if changed else entries)
        return self._device


def _rows(values: Values) -> Values:
    """Return values, (n, c) or (n,), with shape (n, c), without a copy if possible."""
    return values[:, None] if isinstance(values, np.ndarray) and values.ndim == 1 else values
