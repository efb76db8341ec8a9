"""Cache of the sampled emitters of a session: bright triangles, both parts of the sky, and contacts."""

from __future__ import annotations

import numpy as np

from ..patches.patch_scene import PatchScene
from ..scene.memo import Memo
from ..settings import Settings
from .contact import Contacts
from .emitter_split import EmitterSplit, split_light
from .emitters import SampledTriangles, choose_sampled_triangles
from .lighting import DirectLighting
from .sky import Sky, split_sky

#: Maximum size in bytes of a sky that is stored for comparison with the next one.
MAX_SKY_BYTES = 1 << 26


class EmitterCache:
    """Sampled emitters of the last bake, reused while emission, world and geometry are unchanged."""

    def __init__(self) -> None:
        self._triangles, self._sky = Memo[SampledTriangles](), Memo[Sky](MAX_SKY_BYTES)
        self._contacts = Memo[Contacts]()

    def clear(self) -> None:
        """Drop the data that depends on geometry."""
        self._triangles.clear()
        self._contacts.clear()

    def clear_contacts(self) -> None:
        """Drop the contacts, which change with the set of emissive patches."""
        self._contacts.clear()

    def split(self, world: np.ndarray, patch_scene: PatchScene, settings: Settings) -> EmitterSplit:
        """Return the emission of surfaces and world split into sampled light and light for the gather."""

        def triangles(patch_scene: PatchScene) -> SampledTriangles:
            inputs = patch_scene.surfaces.emission, patch_scene.surfaces.back_emission
            return self._triangles.get(inputs, lambda: choose_sampled_triangles(patch_scene))

        def sky(world: np.ndarray) -> Sky:
            return self._sky.get((world,), lambda: split_sky(world))

        return split_light(world, patch_scene, settings, triangles, sky)

    def contacts(self, lighting: DirectLighting) -> Contacts:
        """Return the contacts of the patches; see `DirectLighting.contacts`."""
        return self._contacts.get((), lighting.contacts)
