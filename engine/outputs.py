"""Registry of bake outputs: label, tool-tip, maps, required rays and cost of each.

The setting `outputs`, its checks, the work estimate, the file formats and the panel are derived from it. The
computation of each output is in `engine.postprocess.output_maps`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

#: Maps of output "directional": L0 + L1 . n' is E/pi for a normal n' in world space.
DIRECTIONAL_MAPS = ("L0", "L1 x", "L1 y", "L1 z")

#: Maps of output "spherical_harmonics": radiance projected on the first two bands (SH L0, SH L1).
PROJECTED_MAPS = ("SH L0", "SH L1 x", "SH L1 y", "SH L1 z")

#: Map of output "dominant_direction": luminance of L1 divided by luminance of E/pi.
DOMINANT_DIRECTION = "dominant_direction"

#: Prefix of the names of light group maps.
LIGHT_GROUP = "light_group "


@dataclass(frozen=True)
class Output:
    """Output of a bake, a choice of the setting `outputs`.

    label, text:        name and tool-tip in the interface
    is_light:           True if its map holds E/pi
    is_fraction:        True if its maps hold fractions in [0, 1], to which no exposure applies
    is_directional:     True if its maps describe E/pi for any normal
    maps:               names of its maps; empty for one map with the name of the output, or one for each
                        light
    signed_maps:        maps with negative values; all others hold light or fractions
    ratio_maps:         maps without unit, to which no color management applies
    decoding:           formula of E/pi from its maps; n is the surface normal, n' the mapped normal
    requires_combined:  True if it is useless without output "combined"
    excludes:           outputs that cannot be baked with it
    ray_setting:        setting with its own rays for each patch; empty if it needs none
    rays_per_light:     True if it needs these rays for each light
    denoised_images:    number of images that the denoiser filters for it
    settings:           settings that apply to it alone
    """

    label: str
    text: str
    is_light: bool = False
    is_fraction: bool = False
    is_directional: bool = False
    maps: tuple[str, ...] = ()
    signed_maps: tuple[str, ...] = ()
    ratio_maps: tuple[str, ...] = ()
    decoding: str = ""
    requires_combined: bool = False
    excludes: tuple[str, ...] = ()
    ray_setting: str = ""
    rays_per_light: bool = False
    denoised_images: int = 0
    settings: tuple[str, ...] = ()


#: Outputs by name, in the order of the interface.
OUTPUTS: Mapping[str, Output] = MappingProxyType({
    "combined": Output(
        "Combined", "All light that a surface receives", is_light=True, denoised_images=1
    ),
    "direct": Output(
        "Direct", "Light that comes straight from lights, emissive surfaces and the world",
        is_light=True, denoised_images=1,
    ),
    "indirect": Output(
        "Indirect", "Light that other surfaces reflect", is_light=True, denoised_images=1
    ),
    "ambient_occlusion": Output(
        "Ambient Occlusion", "Fraction of the hemisphere without a surface nearby",
        is_fraction=True, ray_setting="ao_samples",
        settings=("ao_samples", "ao_distance"),
    ),
    "shadow_mask": Output(
        "Shadow Masks", "One map per light: 1 where the light is fully visible, 0 in its shadow",
        is_fraction=True, ray_setting="light_samples", rays_per_light=True,
    ),
    "directional": Output(
        "Directional",
        "Four maps with Combined, L0 and L1 x, y, z: shade a world-space normal n with L0 + L1 . n",
        is_directional=True, maps=DIRECTIONAL_MAPS, signed_maps=DIRECTIONAL_MAPS,
        decoding="max(0, L0 + L1x n'.x + L1y n'.y + L1z n'.z), n' unit, world space, z up",
        requires_combined=True, excludes=("spherical_harmonics",),
        denoised_images=6,
    ),
    "dominant_direction": Output(
        "Dominant Direction",
        "World-space map D of the main light direction: shade normal n as Combined (1 + D . (n - m))",
        is_directional=True, maps=(DOMINANT_DIRECTION,), signed_maps=(DOMINANT_DIRECTION,),
        ratio_maps=(DOMINANT_DIRECTION,),
        decoding="combined max(0, 1 + D . (n' - n)), D = rgb, signed, world space, z up",
        requires_combined=True, excludes=("spherical_harmonics",),
        denoised_images=2,
    ),
    "spherical_harmonics": Output(
        "Spherical Harmonics",
        "Four maps as in Bakery, SH L0 and SH L1 x, y, z: shade a world-space normal n with "
        "SH L0 (1 + 2 SH L1 . n)",
        is_directional=True, maps=PROJECTED_MAPS, signed_maps=PROJECTED_MAPS[1:],
        ratio_maps=PROJECTED_MAPS[1:],
        decoding="SH L0 max(0, 1 + 2 (SH L1x n'.x + SH L1y n'.y + SH L1z n'.z)), n' unit, world space, z up",
        requires_combined=True, excludes=("directional", "dominant_direction"),
        denoised_images=7,
    ),
    "light_groups": Output(
        "Light Groups",
        "One map per light group of the view layer and one for ungrouped light. They sum to Combined",
        requires_combined=True, denoised_images=1,
    ),
})  # fmt: skip

#: Maps with negative values.
SIGNED_MAPS = tuple(name for output in OUTPUTS.values() for name in output.signed_maps)

#: Maps that hold ratios or directions without unit.
RATIO_MAPS = tuple(name for output in OUTPUTS.values() for name in output.ratio_maps)

#: Decoding formula of each directional map.
DECODING = {name: output.decoding for output in OUTPUTS.values() for name in output.maps}


def is_light(name: str) -> bool:
    """Return True if a map of `output_names` holds E/pi."""
    return is_of_light_group(name) or (name in OUTPUTS and OUTPUTS[name].is_light)


def is_of_light_group(name: str) -> bool:
    """Return True if a map of `output_names` belongs to a light group."""
    return name.startswith(LIGHT_GROUP)


def is_fraction(name: str) -> bool:
    """Return True if a map of `output_names` holds fractions in [0, 1]."""
    return name.startswith(tuple(output for output, entry in OUTPUTS.items() if entry.is_fraction))
