"""Materials that light passes through."""

from dataclasses import replace

import numpy as np

from engine import Material
from engine.scene.transmission import CLEAR, Transmission, Transmittance, from_opacity


def uniform_transmission(transmittance: Transmittance) -> Transmission:
    """Return the transmission of a surface with equal transmittance for all rays and both sides."""
    return Transmission(transmittance, transmittance)


def transparent(alpha=1.0, texture=None, threshold=None) -> Transmission:
    """Return grey transmission of a surface, the same from both sides."""
    return uniform_transmission(from_opacity(alpha, texture, threshold))


def clear_back(material: Material) -> Material:
    """Return a material whose back stops no light."""
    seen = replace(material.transmission, shadow_back=CLEAR, bounce_back=CLEAR)
    return replace(material, transmission=seen)


#: What only the front stops.
CLEAR_BACK = Transmission(shadow_back=CLEAR, bounce_back=CLEAR)


def exact_transmittance(cosine, ior):
    """Return the transmittance of a face by Snell's law and Fresnel's amplitudes."""
    inner = np.sqrt(np.maximum(1 - (1 - cosine**2) / ior**2, 0))
    s, p = (cosine - ior * inner) / (cosine + ior * inner), (ior * cosine - inner) / (ior * cosine + inner)
    reflected = (s**2 + p**2) / 2
    return np.sqrt((1 - reflected) / (1 + reflected))
