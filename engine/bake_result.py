"""Results of a bake: lightmaps, report and flux balance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class FluxBalance:
    """Flux balance of a bake, W, mean of the channels: emitted = absorbed + escaped + not_bounced.

    Light of lights that misses all patches is not included.

    emitted:      emission of front faces, and light from lights, sky and emissive back faces that reaches
                  patches
    absorbed:     flux absorbed by front faces, and by black back faces that are visible from front faces
    escaped:      flux that leaves the scene
    not_bounced:  flux that the last iteration reflected and no patch has gathered
    """

    emitted: float
    absorbed: float
    escaped: float
    not_bounced: float

    @property
    def missing(self) -> float:
        """Balance error as a fraction of the emitted flux; 0 without light."""
        rest = self.emitted - self.absorbed - self.escaped - self.not_bounced
        return rest / self.emitted if self.emitted > 0 else 0.0


@dataclass(frozen=True)
class Report:
    """Report of a bake.

    patches:            number of patches
    method:             "paper", "cached" or "stream"; "none" without any light
    visibility:         visibility sampler, "raster" or "rays"; "none" if visibility was not needed
    samples:            visibility samples of each patch
    reasons:            sentences that explain the choices
    iterations:         number of iterations
    convergence_error:  estimated mean error of the patches, relative to the light of each
    converged:          True if the convergence error is below the tolerance
    added_flux:         flux added by each iteration, W, sum of the channels
    seconds:            wall time of each stage, s
    devices:            OpenGL renderer under "gl"; OpenCL device under "cl" if there is one
    warnings:           messages for the user
    integrator:         integrator of the hemicubes: "opencl", or "glsl" for OpenGL compute shaders
    paces:              seconds for each unit of work of each stage, from this bake or earlier ones, see
                        `BakeStages`
    resumed:            sentences that name the data of an interrupted bake that was reused
    energy:             flux balance; None without an iteration, with method "paper" and without OpenCL, where
                        the validity of patches is not measured
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
class ProbeGrid:
    """Radiance over the sphere at the n probes of a volume.

    name:          name of the volume
    resolution:    number of probes along the x, y and z axes of the volume
    matrix:        (4, 4) float64, from the unit cube [-1, 1]^3 to world axes, m, relative to `Scene.origin`
    coefficients:  (n, 9, 3) float32, W/(m^2 sr), SH L2 of the radiance in world axes, see
                   engine/probes/spherical_harmonics.py; x varies fastest among the probes, then y
    validity:      (n,) float32, 1 for probes at their place, 0.5 for probes moved out of geometry, 0 for
                   probes inside geometry, whose light comes from valid neighbours
    positions:     (n, 3) float32, m, of the light, relative to `Scene.origin`
    groups:        the same coefficients of each light group by name; empty without the output light groups
    distances:     (n, 8, 8, 2) float32, mean distance, m, and mean squared distance, m^2, of the surfaces
                   around `positions` on octahedral maps; v, then u, from the bottom left. Empty without them
    """

    name: str
    resolution: tuple[int, int, int]
    matrix: np.ndarray
    coefficients: np.ndarray
    validity: np.ndarray
    positions: np.ndarray
    groups: dict[str, np.ndarray] = field(default_factory=dict)
    distances: np.ndarray = field(default_factory=lambda: np.zeros((0, 8, 8, 2), np.float32))


@dataclass(frozen=True)
class ReflectionCube:
    """Radiance around a reflection sphere, as a prefiltered cube map.

    sphere:  index into `Scene.reflection_spheres`
    levels:  (6, s, s, 3) float32 each, W/(m^2 sr), faces of width s as in engine/reflections/cube_faces.py,
             top row first. Level k of n has GGX alpha (k / (n - 1))^2 and half the width of the one before
    """

    sphere: int
    levels: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class BakeResult:
    """Lightmaps of all atlases; row 0 is the bottom row (v = 0), as in OpenGL and Blender.

    image:      (atlases, h, w, 3) float32, first output at texel centres, before supersampling and fill, 0
                where `has_patch` is False; empty without the setting `centres`
    display:    (atlases, h, w, 3) float32, first output as stored: supersampled, equal across seams, with
                invalid texels filled and charts dilated
    has_patch:  (atlases, h, w) bool, texels that are patches
    known:      (atlases, h, w) bool, texels of `display` that are not filled
    report:     report of the bake
    passes:     each output map by name, processed like `display`; names and units are in `engine.outputs`
    probes:     radiance at the probes of each volume
    reflections:  cube map of each sphere
    """

    atlases: tuple[str, ...]
    image: np.ndarray
    display: np.ndarray
    has_patch: np.ndarray
    known: np.ndarray
    report: Report = field(repr=False)
    passes: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    probes: tuple[ProbeGrid, ...] = field(default=(), repr=False)
    reflections: tuple[ReflectionCube, ...] = field(default=(), repr=False)
