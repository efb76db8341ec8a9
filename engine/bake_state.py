"""State of a bake: intermediate results that a caller may read before they are released."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from .device.device_array import Values
from .direct.contact import Contacts
from .patches.patch_scene import PatchScene
from .postprocess.refined_texels import RefinedTexels
from .scene.model import Scene
from .settings import Settings
from .solve.solution import Solution
from .texel_gather.texel_sample_gather import TexelSampleLight
from .visibility.rays.ray_scene import RayScene


@dataclass(frozen=True)
class BakeState:
    """Intermediate results of a bake of n patches.

    scene:     with charts for objects without a lightmap and for back faces
    atlases:   number of the user's lightmaps, the first of `scene.atlases`
    rays:      casts rays from all patches
    contacts:  faces that touch patches
    validity:  (n,) float32, fraction of each patch's hemisphere without back faces
    outputs:   values of the patches, (n, 3) or (n,) float32, by output
    samples:   texel samples with their light
    texels:    texel values from patches and texel samples
    images:    final images, (atlases, r, r, 3) float32, by output
    """

    scene: Scene
    atlases: int
    settings: Settings
    patch_scene: PatchScene
    rays: RayScene
    contacts: Contacts
    solution: Solution
    validity: np.ndarray
    outputs: Mapping[str, Values]
    samples: TexelSampleLight
    texels: RefinedTexels
    images: Mapping[str, np.ndarray]


#: Inspects the state of a bake while its devices are open; it must not change anything.
Inspect = Callable[[BakeState], None]


def ignore(state: BakeState) -> None:
    """Do nothing with the state; default value of `inspect`."""
