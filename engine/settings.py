"""What a user may choose about a bake: each setting is described here, and nowhere else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from types import MappingProxyType

from .errors import SettingsError
from .setting_types import (
    PREFERENCES,
    Address,
    Description,
    DeviceName,
    FilePath,
    OneOf,
    Option,
    Size,
    SomeOf,
    Span,
    Switch,
    described,
)

_METHODS = {
    "auto": Option("Automatic", "Cached if there is memory for it, else Stream"),
    "cached": Option(
        "Cached",
        "Compute visibility once and reuse it for every bounce. Needs memory",
    ),
    "stream": Option("Stream", "Recompute visibility for every bounce. Slow, needs no memory"),
    "paper": Option("Paper", "Draw radiance hemicubes anew in every iteration, as in the paper"),
}
_VISIBILITIES = {
    "auto": Option(
        "Automatic",
        "Time both on the scene and use the faster. Fix one for repeatable results",
    ),
    "raster": Option("Raster", "Draw hemicubes with OpenGL"),
    "rays": Option("Rays", "Cast rays with OpenCL"),
}
_DIRECTIONS = {
    "cosine": Option("Cosine", "Low-discrepancy directions that follow the cosine: all weigh the same"),
    "hemicube": Option("Hemicube", "The texels of a hemicube, as drawing has them"),
}
_OUTPUTS = {
    "combined": Option("Combined", "All light that a surface receives"),
    "direct": Option("Direct", "Light that comes straight from lights, emissive surfaces and the world"),
    "indirect": Option("Indirect", "Light that other surfaces reflect"),
    "ambient_occlusion": Option("Ambient Occlusion", "Part of the hemisphere without a surface nearby"),
    "shadow_mask": Option("Shadow Masks", "A map for each light: 1 where it is seen whole, 0 in its shadow"),
    "directional": Option(
        "Directional",
        "Four maps beside Combined, L0 and L1 x, y, z: a normal map n in world space shows L0 + L1 . n",
    ),
    "dominant_direction": Option(
        "Dominant Direction",
        "A map beside Combined of where most light comes from, in world space: where a normal map turns the "
        "normal m to n, it shows Combined (1 + Direction . (n - m))",
    ),
    "spherical_harmonics": Option(
        "Spherical Harmonics",
        "Four maps beside Combined as Bakery has them, SH L0, and SH L1 x, y, z in parts of it, from -1 to "
        "1: a normal map n in world space shows SH L0 (1 + 2 SH L1 . n)",
    ),
    "light_groups": Option(
        "Light Groups",
        "A map beside Combined for each light group of the view layer, and one for light in none: together "
        "they are Combined, and the preview mixes them",
    ),
}
#: Outputs of E/pi: all light, or parts of it.
LIGHT_OUTPUTS = ("combined", "direct", "indirect")

_DIRECTIONAL = ("directional", "dominant_direction", "spherical_harmonics")

#: Outputs that are maps beside the one of all light.
_BESIDE_COMBINED = (*_DIRECTIONAL, "light_groups")

#: Outputs that tell where light comes from in another way: a bake makes those of one.
_RULED_OUT = {
    "directional": {"spherical_harmonics"},
    "dominant_direction": {"spherical_harmonics"},
    "spherical_harmonics": {"directional", "dominant_direction"},
}
_PATCH_GROUPS = {
    0: Option("Automatic", "Squares of 4 x 4 patches if memory is short"),
    1: Option("Off", "Every patch is solved on its own"),
    **{
        width: Option(
            f"{width} x {width}", f"Squares of {width} x {width} patches are one in all bounces but the last"
        )
        for width in (2, 4, 8)
    },
}

#: A patch takes no more `light_samples` than for this many lights, however many there are.
MOST_LIGHTS = 8

#: The column reduction of the paper halves the width of a hemicube, so it is a power of two.
_HEMICUBES = {
    width: Option(str(width), f"{width} texels wide: {3 * width * width} samples per patch")
    for width in (8, 16, 32, 64, 128, 256)
}

_TEXEL_SAMPLES = {
    1: Option("Off", "Every texel shows the light at its centre"),
    **{
        count: Option(str(count), f"{count} points, each with a part of a patch's rays")
        for count in (4, 16, 64)
    },
}

_DENOISE_DEVICES = {
    "cpu": Option("Processor", "Always there"),
    "cuda": Option("CUDA", "A graphics card of NVIDIA"),
    "hip": Option("HIP", "A graphics card of AMD"),
    "sycl": Option("SYCL", "A graphics card of Intel"),
    "metal": Option("Metal", "Apple's graphics"),
}

_BYTES = Span(0, 1 << 50, "bytes", ("MiB", 1 << 20))


@dataclass(frozen=True)
class Settings:
    """The settings of one bake; its description says what each does."""

    resolution: int = described(
        256, "Resolution", "Width and height of each lightmap", Span(8, 16384, "texels"), "bake"
    )
    hemicube: int = described(
        32,
        "Hemicube Resolution",
        "Width of hemicubes in texels; also sets the default number of samples",
        OneOf(_HEMICUBES),
    )
    max_bounces: int = described(
        50,
        "Max Bounces",
        "Maximum number of light bounces",
        Span(1, 1000, "bounces"),
    )
    tolerance: float = described(
        0.002,
        "Tolerance",
        "Stop when the mean convergence error per texel is below this. 0 bakes all bounces",
        Span(0, 1, "of the mean"),
    )
    outputs: tuple[str, ...] = described(
        ("combined",), "Outputs", "What a bake gives: an image of each", SomeOf(_OUTPUTS), "outputs"
    )
    ao_samples: int = described(
        256, "AO Samples", "Rays of each patch for ambient occlusion", Span(1, 65536, "rays"), "outputs"
    )
    ao_distance: float = described(
        1.0,
        "AO Distance",
        "How far ambient occlusion reaches; 0 for any distance",
        Span(0, 1e9, "m"),
        "outputs",
    )
    method: str = described(
        "auto", "Method", "How the light that a patch receives is computed", OneOf(_METHODS)
    )
    visibility: str = described(
        "auto", "Visibility", "How visibility is computed. Method Paper always uses Raster",
        OneOf(_VISIBILITIES),
    )  # fmt: skip
    directions: str = described("cosine", "Directions", "Where the rays of a patch go", OneOf(_DIRECTIONS))
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
    )
    texel_samples: int = described(
        4,
        "Texel Samples",
        "Supersampling of texels at chart borders, shadow edges and intersections. 1 is off",
        OneOf(_TEXEL_SAMPLES),
    )
    sample_emission: bool = described(
        True,
        "Sample Emission",
        "Sample small bright emissive faces and bright sky as lights. Less noise",
        Switch(),
    )
    glass_transmits: bool = described(
        True,
        "Light through Glass",
        "Let light pass straight through glass, refraction and transmission shaders, tinted by their color; "
        "off makes them opaque",
        Switch(),
    )
    accelerate: bool = described(
        True,
        "Accelerate",
        "Start with the ambient light that energy balance demands and mix iterates so that their errors "
        "cancel; off iterates as in the paper",
        Switch(),
    )
    seed: int = described(0, "Seed", "Seed of the random rotation of each hemicube", Span(0, (1 << 32) - 1))
    hide_seams: bool = described(
        True,
        "Hide Seams",
        "Match light across UV seams, also between objects that touch",
        Switch(),
    )
    margin: int = described(
        8, "Margin", "Texels by which charts are extended into the space around them", Span(0, 256, "texels")
    )
    denoise: bool = described(
        False,
        "Denoise",
        "Denoise with Open Image Denoise. Removes detail smaller than the noise",
        Switch(),
        "quality",
    )
    patch_file: str | None = described(
        None,
        "Patch List",
        "File that keeps the patch list between bakes of the same UVs; empty for none",
        FilePath(),
    )
    opencl_device: str | None = described(
        None,
        "OpenCL Device",
        "Device that casts rays and sums light, as platform: device; empty for the first graphics card, else "
        "the first device that works",
        DeviceName(),
        PREFERENCES,
    )
    scheduler: str = described(
        "",
        "Scheduler",
        "Address of a Dask scheduler whose workers find what patches see, as tcp://host:8786; 'all' for a "
        "worker on each device of this machine; empty to bake on one device",
        Address(),
        PREFERENCES,
    )
    denoise_device: str = described(
        "cpu",
        "Denoise Device",
        "What Open Image Denoise computes with; the processor where that is not there",
        OneOf(_DENOISE_DEVICES),
        PREFERENCES,
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
        "Device memory for visibility kept between bakes, for fast relighting. 0 uses a quarter",
        _BYTES,
        PREFERENCES,
    )
    checkpoint_space: int = described(
        4 << 30,
        "Checkpoint Space",
        "Disk space in the cache folder for what bakes have found that were cancelled or killed, and that go "
        "on from there when started again; the oldest gives way, and a bake that ends well removes its own. "
        "0 for none",
        Span(0, 1 << 50, "bytes", ("MiB", 1 << 20)),
        PREFERENCES,
    )
    checkpoint_interval: float = described(
        5.0,
        "Checkpoint Interval",
        "Time between two checkpoints, and before the first: shorter bakes write none",
        Span(0, 86400, "s"),
        PREFERENCES,
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
        "Batch",
        "Memory for one batch of hemicubes",
        Span(1, 1 << 50, "bytes", ("MiB", 1 << 20)),
        PREFERENCES,
    )
    rotate: bool = described(
        True,
        "Rotate Hemicubes",
        "Turn every hemicube at random about its normal, once for all iterations (paper, Fig. 6)",
        Switch(),
        "paper",
    )
    align_uvs: bool = described(
        False,
        "Align UVs",
        "Move lightmap UVs to borders of texels, by half a texel at most, as the patch list is made "
        "(paper, VI.B): for UVs that were not aligned when they were made. The UV layers stay",
        Switch(),
        "paper",
    )
    half_radiance: bool = described(
        False,
        "Half Floats",
        "Draw the paper's hemicubes in 16-bit floats where OpenGL sums them: faster where pixels are what "
        "takes long",
        Switch(),
        "paper",
    )
    array_size: tuple[int, int, int] = described(
        (0, 0, 0),
        "Texture Array",
        "Width, height and layers of the array that hemicubes are drawn into, in texels; 0 for as many as "
        "the batch holds",
        Size(),
        "paper",
    )
    intermediates: bool = described(
        True, "Intermediate Lightmaps", "Yield the lightmaps so far after each iteration", Switch(), None
    )
    centres: bool = described(
        True, "Light at Centres", "Return what patches receive apart from what is shown", Switch(), None
    )
    warm_start: bool = described(
        False,
        "Warm Start",
        "Show at once the light of the session's last bake with the new direct light, and go on from there; "
        "the light converges to that of a bake of its own",
        Switch(),
        None,
    )
    denoise_library: str | None = described(
        None,
        "Denoise Library",
        "File of Open Image Denoise; None for that of an installed Python package",
        FilePath(),
        None,
    )
    cache_dir: str | None = described(
        None, "Cache", "Folder for compiled kernels and checkpoints; None keeps none", FilePath(), None
    )

    @property
    def light_outputs(self) -> tuple[str, ...]:
        """The outputs that hold light."""
        return tuple(name for name in self.outputs if name in LIGHT_OUTPUTS)

    @property
    def directional_outputs(self) -> tuple[str, ...]:
        """The outputs that tell where light comes from."""
        return tuple(name for name in self.outputs if name in _DIRECTIONAL)

    @property
    def directional(self) -> bool:
        """True if an output tells where light comes from."""
        return bool(self.directional_outputs)

    @property
    def projected(self) -> bool:
        """True if that is told by a projection on spherical harmonics instead of a fit."""
        return "spherical_harmonics" in self.outputs

    @property
    def only_light(self) -> bool:
        """True if all outputs are black where there is no light."""
        return set(self.outputs) <= {*LIGHT_OUTPUTS, *_BESIDE_COMBINED}

    @property
    def by_light_groups(self) -> bool:
        """True if light groups have maps of their own."""
        return "light_groups" in self.outputs

    @property
    def has_indirect(self) -> bool:
        """True if an output holds light that was reflected."""
        return not {"combined", "indirect"}.isdisjoint(self.outputs)

    @property
    def accelerated(self) -> bool:
        """True if iterates are mixed: not in the paper's method, and where one sweep is enough."""
        return self.accelerate and self.method != "paper" and self.has_indirect


@cache
def descriptions() -> Mapping[str, Description]:
    """Return what is known of each setting, by name, in the order of the interface."""
    return MappingProxyType({entry.name: entry.metadata["description"] for entry in fields(Settings)})


def chosen_by_people() -> list[str]:
    """Return the names of the settings that a person chooses, in the order of the interface."""
    return [name for name, description in descriptions().items() if description.panel is not None]


def kept_with_scene() -> list[str]:
    """Return the names of the settings that describe how a scene is baked: they belong to the .blend."""
    return [name for name in chosen_by_people() if descriptions()[name].panel != PREFERENCES]


def shown_in(panel: str) -> list[str]:
    """Return the names of the settings that a panel of the interface shows, one of `setting.PANELS`."""
    return [name for name, description in descriptions().items() if description.panel == panel]


def with_output(outputs: set[str], wanted: str) -> set[str]:
    """Return outputs with one more: with Combined if it is a map beside it, without what it rules out."""
    beside = {"combined"} if wanted in _BESIDE_COMBINED else set()
    return {*outputs, wanted, *beside} - _RULED_OUT.get(wanted, set())


def without_output(outputs: set[str], unwanted: str) -> set[str]:
    """Return outputs without one, and without the maps beside it."""
    return outputs - {unwanted, *(_BESIDE_COMBINED if unwanted == "combined" else ())}


def check_settings(settings: Settings) -> None:
    """Raise a SettingsError that names the first setting out of its range, or at odds with others."""
    for name, description in descriptions().items():
        description.check(name, getattr(settings, name))
    if settings.directional:
        _check_directional(settings)
    if settings.by_light_groups and "combined" not in settings.outputs:
        raise SettingsError(
            f"outputs is {', '.join(settings.outputs)}; maps of light groups sum up to the lightmap of all "
            "light: choose combined, too."
        )


def _check_directional(settings: Settings) -> None:
    """Raise a SettingsError if directional maps cannot be made, or would have nothing to go with."""
    if "combined" not in settings.outputs:
        raise SettingsError(
            f"outputs is {', '.join(settings.outputs)}; directional maps go with the lightmap of all light: "
            "choose combined, too."
        )
    if settings.projected and not _RULED_OUT["spherical_harmonics"].isdisjoint(settings.outputs):
        raise SettingsError(
            f"outputs is {', '.join(settings.outputs)}; spherical_harmonics tells where light comes from in "
            "another way than directional and dominant_direction: bake one of both."
        )
    if settings.method == "paper":
        raise SettingsError(
            "method is paper, whose hemicubes tell no directions; choose auto, cached or stream, or leave "
            "directional, dominant_direction and spherical_harmonics out of outputs."
        )
