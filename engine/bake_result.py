"""What comes out of a bake."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class FluxBalance:
    """Where the light of a bake goes: emitted = absorbed + escaped + not_bounced, W, mean of the channels.

    emitted   what fronts of patches emit, and what else reaches them: of lamps, the sky, backs that shine
    absorbed  by fronts, and by backs that fronts see, which are black
    escaped   what fronts send to where nothing is
    not_bounced  what the last iteration reflected, which nobody has gathered yet

    What lamps send past all patches is in none of them.
    """

    emitted: float
    absorbed: float
    escaped: float
    not_bounced: float

    @property
    def missing(self) -> float:
        """What is missing on the right side, as a fraction of what is emitted; 0 in the dark."""
        rest = self.emitted - self.absorbed - self.escaped - self.not_bounced
        return rest / self.emitted if self.emitted > 0 else 0.0


@dataclass(frozen=True)
class Report:
    """The facts of a bake.

    patches     number of patches
    method      how they gathered, "paper", "cached" or "stream"; "none" if no light reached any
    visibility  how it was found what they see, "raster" or "rays"; "none" if that was not looked for
    samples     of what each patch sees
    reasons     why, in sentences
    iterations  iterations run
    convergence_error  estimated remaining error, relative to each patch's light, on average
    converged   True if the convergence error is below the tolerance
    added_flux  flux added by each iteration, W, sum of the channels
    seconds     wall time of each stage, s
    devices     the GL renderer under "gl", the CL device under "cl" if there is one
    warnings    sentences for the user
    integrator  what summed the hemicubes: "opencl", or "glsl" for OpenGL's compute shaders
    paces       seconds that a unit of each stage took, in this bake or earlier ones, see `BakeStages`
    resumed     what it went on from, of a bake that was interrupted, in sentences
    energy      where the light goes; None without an iteration, and where hemicubes are summed at once, by
                method "paper" or without OpenCL: these do not tell what part of a view patches take
    """

    patches: int
    method: str
    visibility: str
    samples: int
    reasons: tuple[str, ...]
    iterations: int
    convergence_error: float
    converged: bool
    added_flux: tuple[float, ...]
    seconds: dict[str, float]
    devices: dict[str, str]
    warnings: tuple[str, ...] = ()
    integrator: str = "opencl"
    paces: dict[str, float] = field(default_factory=dict)
    resumed: tuple[str, ...] = ()
    energy: FluxBalance | None = None


@dataclass(frozen=True)
class BakeResult:
    """Every atlas of a bake; row 0 is the bottom row (v = 0), as in OpenGL and Blender.

    image      (atlases, h, w, 3) float32, the first output asked for (E/pi of all light unless set
               otherwise); 0 where `has_patch` is False; of no atlas unless the settings ask for `centres`
    display    (atlases, h, w, 3) float32, what is stored: texels that show more than their centre have the
               mean of several points; without seams, hidden texels filled, charts dilated
    has_patch  (atlases, h, w) bool, texels that are patches
    known      (atlases, h, w) bool, texels of `display` that are not filled
    passes     every output asked for, as `display`, by name: "combined", "direct", "indirect" (E/pi),
               "ambient_occlusion" (1 where nothing is near), "shadow_mask NAME" for each light (1
               where it is seen whole), "light_group NAME" for each group of light (E/pi; together they are
               "combined"), and, signed, "L0", "L1 x", "L1 y", "L1 z" and "dominant_direction"
               (see `postprocess.directional_maps.directional_maps`), "SH L0" and signed "SH L1 x", "SH L1 y",
               "SH L1 z" (see `postprocess.directional_maps.projected_maps`)
    """

    atlases: tuple[str, ...]
    image: np.ndarray
    display: np.ndarray
    has_patch: np.ndarray
    known: np.ndarray
    report: Report = field(repr=False)
    passes: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
