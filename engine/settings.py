"""What a user may choose about a bake."""

from __future__ import annotations

from dataclasses import dataclass

from .errors import SettingsError

#: Methods in the order of the user interface.
METHODS = ("auto", "cached", "stream", "paper")

#: Ways to find what patches see, and what directions rays may take, in the order of the user interface.
VISIBILITIES = ("auto", "raster", "rays")
DIRECTIONS = ("cosine", "hemicube")

#: Widths of squares of patches.
SHARED_BOUNCES = (0, 1, 2, 4, 8)

#: What a bake can give, in the order of the user interface.
OUTPUTS = ("combined", "direct", "indirect", "ambient_occlusion", "shadow_mask")

#: Hemicube resolutions: the column reduction halves the width, so a power of two.
HEMICUBES = (8, 16, 32, 64, 128, 256)


@dataclass(frozen=True)
class Settings:
    """The settings of one bake.

    resolution  width and height of each lightmap, texels, 8 ... 16384
    hemicube    width N of a hemicube, texels, one of HEMICUBES
    iterations  largest number of iterations (bounces), 1 ... 1000
    tolerance   stop once the estimated remaining error of the patches, each relative to its own
                light, is below this on average; 0 never stops early
    method      one of METHODS: "auto" is "cached" if that fits into memory, else "stream"
    visibility  one of VISIBILITIES: "auto" casts rays, and tries drawing first where these take long; the
                paper's method only draws
    samples     rays of a patch, 4 ... 65536, or 0 for as many as give the error of a hemicube
    directions  of rays, one of DIRECTIONS
    shared_bounces  width of the squares of patches that share their bounces, one of SHARED_BOUNCES, texels:
                each patch then gathers once more for itself; 1 for none, 0 to do so if memory is short
    half_radiance  True draws the paper's hemicubes in 16-bit floats, where OpenGL sums them: faster where
                pixels are what takes long
    accelerate  False iterates as the paper does
    memory_budget  device memory for what patches see, bytes; 0 for half of the device's
    outputs     what the bake gives, some of OUTPUTS; shadow_mask gives a map for each light
    light_samples  shadow rays a patch sends to each light, 1 ... 4096
    sample_emission  False leaves emissive surfaces and the sky to the hemicubes, as in the paper
    ao_samples  rays of a patch for ambient occlusion, 1 ... 65536
    ao_distance how far they reach, m; 0 for any distance
    seed        seed of the per-patch random rotations, 0 ... 2^32 - 1
    rotate      False keeps every hemicube at rotation 0 (paper, Fig. 6, top row)
    array_size  (width, height, layers) of the hemicube texture array in texels, or None to
                size it from batch_bytes
    batch_bytes memory for one batch of hemicubes, bytes
    partials    False yields no partial lightmaps: nobody looks at them
    dilation    how far charts are dilated for display, texels
    patch_file  file that the patch list is loaded from, or stored in if it does not exist; or None
    cache_dir   folder for compiled kernels, or None for PyOpenCL's own
    """

    resolution: int = 256
    hemicube: int = 32
    iterations: int = 50
    tolerance: float = 0.002
    method: str = "auto"
    visibility: str = "auto"
    samples: int = 0
    directions: str = "cosine"
    shared_bounces: int = 0
    half_radiance: bool = False
    accelerate: bool = True
    memory_budget: int = 0
    partials: bool = True
    outputs: tuple[str, ...] = ("combined",)
    light_samples: int = 64
    sample_emission: bool = True
    ao_samples: int = 256
    ao_distance: float = 1.0
    seed: int = 0
    rotate: bool = True
    array_size: tuple[int, int, int] | None = None
    batch_bytes: int = 64 << 20
    dilation: int = 8
    patch_file: str | None = None
    cache_dir: str | None = None

    @property
    def bounces(self) -> bool:
        """True if an output holds light that was reflected."""
        return not {"combined", "indirect"}.isdisjoint(self.outputs)


def check_settings(settings: Settings) -> None:
    """Raise a SettingsError that names the first setting out of its range."""
    _check_range("resolution", settings.resolution, 8, 16384, "texels")
    _check_range("iterations", settings.iterations, 1, 1000, "iterations")
    _check_range("tolerance", settings.tolerance, 0, 1, "of the mean")
    _check_range("dilation", settings.dilation, 0, 256, "texels")
    _check_range("light_samples", settings.light_samples, 1, 4096, "rays")
    if settings.samples:
        _check_range("samples", settings.samples, 4, 65536, "rays, or 0 for as many as a hemicube needs")
    _check_range("memory_budget", settings.memory_budget, 0, 1 << 50, "bytes")
    _check_range("batch_bytes", settings.batch_bytes, 1, 1 << 50, "bytes")
    _check_range("seed", settings.seed, 0, (1 << 32) - 1, "")
    _check_range("ao_samples", settings.ao_samples, 1, 65536, "rays")
    _check_range("ao_distance", settings.ao_distance, 0, 1e9, "m")
    outputs = set(settings.outputs)
    if not outputs or not outputs <= set(OUTPUTS) or len(outputs) < len(settings.outputs):
        chosen = ", ".join(settings.outputs) or "empty"
        raise SettingsError(
            f"outputs is {chosen}; choose at least one of {', '.join(OUTPUTS)}, each once at most."
        )
    _check_choice("hemicube", settings.hemicube, HEMICUBES)
    _check_choice("shared_bounces", settings.shared_bounces, SHARED_BOUNCES)
    _check_choice("method", settings.method, METHODS)
    _check_choice("visibility", settings.visibility, VISIBILITIES)
    _check_choice("directions", settings.directions, DIRECTIONS)


def _check_range(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        raise SettingsError(f"{name} is {value:g}; choose {low:g} to {high:g} {unit}".rstrip() + ".")


def _check_choice(name: str, value: str | int, choices: tuple[str, ...] | tuple[int, ...]) -> None:
    if value not in choices:
        raise SettingsError(f"{name} is {value!r}; choose one of {', '.join(map(str, choices))}.")
