"""Settings of a bake: each with default, valid values, label and tool-tip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from types import MappingProxyType

from .errors import SettingsError
from .outputs import OUTPUTS
from .setting_types import (
    PREFERENCES,
    Address,
    Description,
    DeviceName,
    FilePath,
    OneOf,
    Option,
    Size,
    Span,
    SubsetOf,
    Switch,
    described,
)

#: Value of `Settings.scheduler` for all devices of this machine.
ALL_DEVICES = "all"

_METHODS = {
    "auto": Option("Automatic", "Cached if there is memory for it, else Stream"),
    "cached": Option("Cached", "Compute visibility once and reuse it for every bounce. Needs memory"),
    "stream": Option("Stream", "Recompute visibility for every bounce. Slow, needs no memory"),
    "paper": Option("Paper", "Draw radiance hemicubes for every bounce, as in the paper"),
}
_VISIBILITIES = {
    "auto": Option("Automatic", "Rays, or Raster on devices that cannot cast rays"),
    "raster": Option("Raster", "Draw hemicubes with OpenGL"),
    "rays": Option("Rays", "Cast rays with OpenCL"),
}
_DIRECTIONS = {
    "cosine": Option("Cosine", "Low-discrepancy directions with cosine density and equal weights"),
    "hemicube": Option("Hemicube", "Directions through the pixels of a drawn hemicube"),
}
_OUTPUTS = {name: Option(output.label, output.text) for name, output in OUTPUTS.items()}
_PATCH_GROUPS = {
    0: Option("Automatic", "Groups of 4 x 4 texels if memory is short"),
    1: Option("Off", "Solve every texel separately"),
    **{
        width: Option(
            f"{width} x {width}",
            f"Solve groups of {width} x {width} texels as one in all bounces but the last",
        )
        for width in (2, 4, 8)
    },
}

#: Maximum number of lights that receive `light_samples` shadow rays each; more lights share these rays.
MOST_LIGHTS = 8

#: Valid widths of a hemicube: powers of two, since the paper's column reduction halves the width repeatedly.
_HEMICUBES = {
    width: Option(
        str(width),
        f"Hemicube {width} pixels wide: {3 * width * width} samples for each texel of the lightmap",
    )
    for width in (8, 16, 32, 64, 128, 256)
}

_TEXEL_SAMPLES = {
    1: Option("Off", "One sample at the centre of each texel"),
    **{
        count: Option(str(count), f"{count} points, each with a fraction of the texel's rays")
        for count in (4, 16, 64)
    },
}

_CUBE_SIZES = {
    width: Option(str(width), f"{width} texels; a cube takes {32 * width * width >> 10:,} KiB of GPU memory")
    for width in (64, 128, 256, 512, 1024)
}

_DENOISE_DEVICES = {
    "cpu": Option("CPU", "Always available"),
    "cuda": Option("CUDA", "NVIDIA GPU"),
    "hip": Option("HIP", "AMD GPU"),
    "sycl": Option("SYCL", "Intel GPU"),
    "metal": Option("Metal", "Apple GPU"),
}

_BYTES = Span(0, 1 << 50, "bytes", ("MiB", 1 << 20))


@dataclass(frozen=True)
class Settings:
    """Settings of one bake; see the description of each field."""

    resolution: int = described(
        256, "Resolution", "Width and height of each lightmap", Span(8, 16384, "texels"), "bake"
    )
    hemicube: int = described(
        32,
        "Hemicube",
        "Width of hemicubes in pixels; also sets the default number of samples",
        OneOf(_HEMICUBES),
    )
    max_bounces: int = described(
        50, "Max Bounces", "Maximum number of light bounces", Span(1, 1000, "bounces"), invalidates=()
    )
    tolerance: float = described(
        0.002,
        "Error Threshold",
        "Stop when the mean convergence error per texel is below this. 0 bakes all bounces",
        Span(0, 1, "of the mean"),
        invalidates=(),
    )
    outputs: tuple[str, ...] = described(
        ("combined",),
        "Outputs",
        "Maps to bake, one image each",
        SubsetOf(_OUTPUTS),
        "outputs",
        invalidates=(),
    )
    ao_samples: int = described(
        256,
        "AO Samples",
        "Rays per texel for ambient occlusion",
        Span(1, 65536, "rays"),
        "outputs",
        invalidates=(),
    )
    ao_distance: float = described(
        1.0,
        "AO Distance",
        "Maximum distance of occluding surfaces. 0 is unlimited",
        Span(0, 1e9, "m"),
        "outputs",
        invalidates=(),
    )
    method: str = described(
        "auto",
        "Visibility Data",
        "Keep visibility for all bounces, or compute it again for each",
        OneOf(_METHODS),
    )
    visibility: str = described(
        "auto", "Visibility Tests", "How visibility is computed. Visibility Data: Paper always uses Raster",
        OneOf(_VISIBILITIES),
    )  # fmt: skip
    directions: str = described(
        "cosine", "Directions", "Distribution of the rays of a texel", OneOf(_DIRECTIONS)
    )
    samples: int = described(
        0,
        "Samples",
        "Rays per texel for indirect light. 0 matches the noise of a hemicube",
        Span(4, 65536, "rays", automatic=0),
    )
    adaptive: bool = described(
        False,
        "Adaptive",
        "On the CPU, interpolate indirect light where it is smooth and trace the rest",
        Switch(),
    )
    light_samples: int = described(
        64,
        "Light Samples",
        "Shadow rays per texel and light, four times as many in penumbrae",
        Span(1, 4096, "rays"),
        invalidates=(),
    )
    texel_samples: int = described(
        4,
        "Texel Samples",
        "Supersampling of texels at chart borders, shadow edges and intersections. 1 is off",
        OneOf(_TEXEL_SAMPLES),
        invalidates=(),
    )
    sample_emission: bool = described(
        True,
        "Sample Emission",
        "Sample small bright emissive faces and bright sky as lights. Less noise",
        Switch(),
        invalidates=(),
    )
    glass_transmits: bool = described(
        True,
        "Light through Glass",
        "Let light pass straight through glass, tinted by its color. Off makes glass opaque",
        Switch(),
    )
    accelerate: bool = described(
        True,
        "Accelerate Bounces",
        "Start from ambient light and combine iterations to converge faster. Off iterates as in the paper",
        Switch(),
        invalidates=(),
    )
    seed: int = described(0, "Seed", "Seed of the random directions of rays", Span(0, (1 << 32) - 1))
    hide_seams: bool = described(
        True,
        "Hide Seams",
        "Match light across UV seams, also between objects that touch",
        Switch(),
        invalidates=(),
    )
    margin: int = described(
        8,
        "Margin",
        "Texels by which charts are extended into the space around them",
        Span(0, 256, "texels"),
        invalidates=(),
    )
    light_probes: bool = described(
        False,
        "Light Probes",
        "Bake Light Probe Volumes, which light moving objects. Files for each volume",
        Switch(),
        "outputs",
        invalidates=(),
    )
    probe_samples: int = described(
        300,
        "Probe Samples",
        "Rays per light probe, rounded up to a multiple of 60",
        Span(60, 65520, "rays"),
        "outputs",
        invalidates=(),
    )
    probes_indirect_only: bool = described(
        False,
        "Indirect Only",
        "Leave direct light out of light probes, for engines that compute it",
        Switch(),
        "outputs",
        invalidates=(),
    )
    probe_distances: bool = described(
        False,
        "Probe Distances",
        "Write the distances around light probes, for engines that test which probes are visible",
        Switch(),
        "outputs",
        invalidates=(),
    )
    reflection_cubes: bool = described(
        False,
        "Reflection Cubes",
        "Bake a cube map at each Light Probe Sphere, for reflections in engines. Files for each sphere",
        Switch(),
        "outputs",
        invalidates=(),
    )
    reflection_size: int = described(
        256,
        "Cube Resolution",
        "Width of the faces of reflection cubes",
        OneOf(_CUBE_SIZES),
        "outputs",
        invalidates=(),
    )
    denoise: bool = described(
        False,
        "Denoise",
        "Denoise with Open Image Denoise, if Blender contains it. Removes detail smaller than the noise",
        Switch(),
        "quality",
        invalidates=(),
    )
    patch_file: str | None = described(
        None,
        "Texel List File",
        "File that stores the list of texels between bakes with the same UVs. Empty for none",
        FilePath(),
    )
    opencl_device: str | None = described(
        None,
        "OpenCL Device",
        "OpenCL device of the bake, as platform: device. Empty for the first GPU, else the first that works",
        DeviceName(),
        PREFERENCES,
    )
    scheduler: str = described(
        "",
        "Scheduler",
        "Address of a Dask scheduler, such as tcp://host:8786. 'all' uses all local GPUs, empty uses one",
        Address(),
        PREFERENCES,
        invalidates=(),
    )
    denoise_device: str = described(
        "cpu",
        "Denoise Device",
        "Device of Open Image Denoise. The CPU is used if the device is missing",
        OneOf(_DENOISE_DEVICES),
        PREFERENCES,
        invalidates=(),
    )
    memory_budget: int = described(
        0,
        "Visibility Memory",
        "Device memory for visibility data. 0 uses half of the device",
        _BYTES,
        PREFERENCES,
    )
    cache_budget: int = described(
        0,
        "Cached Visibility",
        "Device memory for visibility kept between bakes. 0 uses a quarter. Relighting computes the rest",
        _BYTES,
        PREFERENCES,
        invalidates=(),
    )
    checkpoint_space: int = described(
        4 << 30,
        "Checkpoint Space",
        "Disk space in the cache folder for the data of interrupted bakes, which resume from it. 0 for none",
        Span(0, 1 << 50, "bytes", ("MiB", 1 << 20)),
        PREFERENCES,
        invalidates=(),
    )
    checkpoint_interval: float = described(
        5.0,
        "Checkpoint Interval",
        "Time between checkpoints and before the first. Shorter bakes write none",
        Span(0, 86400, "s"),
        PREFERENCES,
        invalidates=(),
    )
    patch_groups: int = described(
        0,
        "Texel Groups",
        "Compute bounces for groups of texels to save memory; the last gather is per texel",
        OneOf(_PATCH_GROUPS),
        "memory",
    )
    batch_bytes: int = described(
        64 << 20,
        "Hemicube Batch",
        "Memory for one batch of hemicubes, if Visibility Data is Paper",
        Span(1, 1 << 50, "bytes", ("MiB", 1 << 20)),
        PREFERENCES,
    )
    rotate: bool = described(
        True,
        "Rotate Hemicubes",
        "Rotate each hemicube at random about its normal, once for all bounces (paper, Fig. 6)",
        Switch(),
        "paper",
    )
    align_uvs: bool = described(
        False,
        "Snap UVs",
        "Snap lightmap UVs to texel borders in the patch list (paper, VI.B). The UV layers stay",
        Switch(),
        "paper",
    )
    half_radiance: bool = described(
        False,
        "Half Floats",
        "Draw the paper's hemicubes in 16-bit floats where OpenGL sums them. Faster if fill rate limits",
        Switch(),
        "paper",
    )
    array_size: tuple[int, int, int] = described(
        (0, 0, 0),
        "Texture Array",
        "Width, height and layers of the texture array of hemicubes, in pixels. 0 fits the batch",
        Size(),
        "paper",
    )
    intermediates: bool = described(
        True,
        "Intermediate Lightmaps",
        "Yield the current lightmaps after each bounce",
        Switch(),
        None,
        invalidates=(),
    )
    centres: bool = described(
        True,
        "Light at Centres",
        "Return the light at texel centres in addition to the final images",
        Switch(),
        None,
        invalidates=(),
    )
    warm_start: bool = described(
        False,
        "Warm Start",
        "Start from the solution of the session's last bake, shown at once with the new direct light",
        Switch(),
        None,
        invalidates=(),
    )
    denoise_library: str | None = described(
        None,
        "Denoise Library",
        "File of Open Image Denoise. None for the installed Python package",
        FilePath(),
        None,
        invalidates=(),
    )
    cache_dir: str | None = described(
        None, "Cache", "Folder for compiled kernels and checkpoints; None keeps none", FilePath(), None
    )

    @property
    def light_outputs(self) -> tuple[str, ...]:
        """Names of the requested outputs that hold irradiance (E/pi)."""
        return tuple(name for name in self.outputs if OUTPUTS[name].is_light)

    @property
    def directional_outputs(self) -> tuple[str, ...]:
        """Names of the requested outputs with directional information."""
        return tuple(name for name in self.outputs if OUTPUTS[name].is_directional)

    @property
    def directional(self) -> bool:
        """True if an output holds directional information."""
        return bool(self.directional_outputs)

    @property
    def projected(self) -> bool:
        """True if the requested directional output is a projection on spherical harmonics."""
        return "spherical_harmonics" in self.outputs

    @property
    def only_light(self) -> bool:
        """True if all outputs are black without light."""
        return not any(OUTPUTS[name].is_fraction for name in self.outputs)

    @property
    def by_light_groups(self) -> bool:
        """True if light groups have separate maps."""
        return "light_groups" in self.outputs

    @property
    def has_indirect(self) -> bool:
        """True if an output includes reflected light."""
        return not {"combined", "indirect"}.isdisjoint(self.outputs)

    @property
    def accelerated(self) -> bool:
        """True if Anderson acceleration mixes iterates; not with method "paper" or a single iteration."""
        return self.accelerate and self.method != "paper" and self.has_indirect


@cache
def descriptions() -> Mapping[str, Description]:
    """Return the description of each setting by name, in the order of the interface."""
    return MappingProxyType({entry.name: entry.metadata["description"] for entry in fields(Settings)})


def chosen_by_people() -> list[str]:
    """Return the names of the settings that users choose, in the order of the interface."""
    return [name for name, description in descriptions().items() if description.panel is not None]


def kept_with_scene() -> list[str]:
    """Return the names of settings that are stored in the .blend file with the scene."""
    return [name for name in chosen_by_people() if descriptions()[name].panel != PREFERENCES]


def shown_in(panel: str) -> list[str]:
    """Return the names of the settings in a panel of the interface, one of `setting_types.PANELS`."""
    return [name for name, description in descriptions().items() if description.panel == panel]


def with_output(outputs: set[str], wanted: str) -> set[str]:
    """Add an output to a set; also add the outputs that it requires, and remove the ones that it excludes."""
    entry = OUTPUTS[wanted]
    required = {"combined"} if entry.requires_combined else set()
    return {*outputs, wanted, *required} - set(entry.excludes)


def without_output(outputs: set[str], unwanted: str) -> set[str]:
    """Remove an output from a set, and the outputs that require it."""
    requiring = {name for name, entry in OUTPUTS.items() if entry.requires_combined}
    return outputs - {unwanted} - (requiring if unwanted == "combined" else set())


def check_settings(settings: Settings) -> None:
    """Raise SettingsError that names the first setting that is out of range or conflicts with others."""
    for name, description in descriptions().items():
        description.check(name, getattr(settings, name))
    if settings.directional:
        _check_directional(settings)
    if settings.by_light_groups and "combined" not in settings.outputs:
        raise SettingsError(
            f"outputs is {', '.join(settings.outputs)}; light group maps require combined. Add combined."
        )


def _check_directional(settings: Settings) -> None:
    """Raise SettingsError if directional outputs conflict with other settings."""
    if "combined" not in settings.outputs:
        raise SettingsError(
            f"outputs is {', '.join(settings.outputs)}; directional maps require combined. Add combined."
        )
    if settings.projected and not {*OUTPUTS["spherical_harmonics"].excludes}.isdisjoint(settings.outputs):
        raise SettingsError(
            f"outputs is {', '.join(settings.outputs)}; spherical_harmonics excludes directional and "
            "dominant_direction. Remove one of both."
        )
    if settings.method == "paper":
        raise SettingsError(
            "method is paper, which supports no directional maps. Choose auto, cached or stream, or remove "
            "directional, dominant_direction and spherical_harmonics from outputs."
        )
