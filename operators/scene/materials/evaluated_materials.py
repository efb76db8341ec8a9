"""Converts pixels evaluated by Cycles to an engine material, with textures or with mean values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....engine.scene.model import BackSide, Material
from ....engine.scene.texture import Texture
from ....engine.scene.transmission import OPAQUE, Fresnel, Transmission, Transmittance
from ..objects.meshes import LIGHTMAP_UVS
from .clear_pixels import box_sums
from .evaluated_passes import COVERED, SMALLEST_PART, Pass, Pixels
from .ray_kinds import BOUNCE, RayKind

#: Difference below which transmittances count as equal, because Cycles rounds the mean of several samples.
_EQUAL = 1e-4

_BACK = RayKind(back=True)


@dataclass(frozen=True)
class EvaluatedMaterial:
    """A material evaluated by Cycles.

    name:       name of the material
    pixels:     finished evaluations, see `evaluated_passes.finish_passes`
    bumps:      factor of its reflectance for its normal map, see `normal_map_reflectance.surface_bumps`
    has_back:   True if the back was evaluated as well
    is_mapped:  True for textures over lightmap UVs, False for means over covered texels
    fresnel:    loss of the light through glass with the angle of incidence; None without glass
    """

    name: str
    pixels: Pixels
    bumps: float
    has_back: bool
    is_mapped: bool
    fresnel: Fresnel | None = None

    def material(self) -> Material:
        """Return the engine's material."""
        reflect, reflect_map = self._light("reflect")
        emit, emit_map = self._light("emit")
        transmit, transmit_map = self._light("transmit")
        return Material(
            self.name,
            reflect * np.float32(self.bumps),
            emit,
            reflectance_map=reflect_map,
            emission_map=emit_map,
            translucency=transmit,
            translucency_map=transmit_map,
            transmission=self._transmission(),
            back=self._back() if self.has_back else None,
        )

    def _back(self) -> BackSide:
        reflect, reflect_map = self._light("reflect", _BACK)
        emit, emit_map = self._light("emit", _BACK)
        return BackSide(reflect * np.float32(self.bumps), emit, reflect_map, emit_map)

    def _light(self, quantity: str, rays: RayKind = BOUNCE) -> tuple[np.ndarray, Texture | None]:
        """Return a quantity as a factor, (3,) float32, and a texture; None without a texture."""
        values = self.pixels.get(Pass(quantity, rays))
        if values is None or not values.any():
            return np.zeros(3, np.float32), None
        through = self.pixels.get(Pass("through", rays))
        if self.is_mapped:
            if through is not None and quantity != "emit":
                values = _spread(values, 1 - through.max(axis=2))
            return np.ones(3, np.float32), self._texture(values)
        weight = np.ones(values.shape[:2]) if through is None else 1 - through.max(axis=2)
        weight = (weight * self._covered)[..., None]
        total = max(float(weight.sum()), 1e-30)
        return ((values * weight).sum(axis=(0, 1)) / total).astype(np.float32), None

    def _transmission(self) -> Transmission:
        bounce = self._transmittance(BOUNCE)
        shadow = self._transmittance(RayKind(shadow=True)) or bounce
        if not self.has_back:
            return Transmission(shadow or OPAQUE, bounce or OPAQUE)
        bounce_back = self._transmittance(_BACK)
        shadow_back = self._transmittance(RayKind(True, True)) or bounce_back
        sides = (shadow, bounce, shadow_back, bounce_back)
        return Transmission(*(side or OPAQUE for side in sides))

    def _transmittance(self, rays: RayKind) -> Transmittance | None:
        """Return the transmittance of one kind of ray; None if it was not evaluated."""
        values = self.pixels.get(Pass("through", rays))
        if values is None:
            return None
        covered = values[self._covered]
        mean = covered.mean(axis=0, dtype=np.float64).astype(np.float32)
        if np.ptp(mean) < _EQUAL:
            mean[:] = mean[0]
        if not self.is_mapped or np.ptp(covered, axis=0).max() < _EQUAL:
            return Transmittance(mean, fresnel=self._falling(rays, mean))
        grey = np.ptp(values, axis=2).max() < _EQUAL
        texture = self._texture(values[..., :1] if grey else values)
        ones = np.ones(3, np.float32)
        return Transmittance(scale=ones, texture=texture, fresnel=self._falling(rays, mean))

    def _falling(self, rays: RayKind, through: np.ndarray) -> Fresnel | None:
        """Return the loss with the angle of incidence for the mean share of glass.

        through:  (3,) float32, mean transmittance
        """
        glass = self.pixels.get(Pass("glass", rays))
        if self.fresnel is None or glass is None:
            return self.fresnel
        share = float(glass[self._covered].mean()) / max(float(through.mean()), 1e-30)
        return replace(self.fresnel, share=min(share, 1.0)) if share else None

    def _texture(self, values: np.ndarray) -> Texture:
        return Texture(self.name, np.ascontiguousarray(values), LIGHTMAP_UVS, extension="extend")

    @property
    def _covered(self) -> np.ndarray:
        """Texels that count for means, (h, w) bool."""
        covered = self.pixels[COVERED]
        return covered if covered.any() else np.ones_like(covered)


def _spread(values: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """Return a quantity, (h, w, 3) float32; clear texels get the mean of the opaque texels around them.

    Without this, interpolation beside a clear texel would darken the opaque part, as at the rim of a leaf.

    opacity:  (h, w) float32
    """
    sums = box_sums(np.concatenate([values * opacity[..., None], opacity[..., None]], axis=2))
    filled = (opacity <= SMALLEST_PART) & (sums[..., 3] > SMALLEST_PART)
    spread = values.copy()
    spread[filled] = sums[filled][:, :3] / sums[filled][:, 3:]
    return spread
