"""Lists of emitter records, sampled by shadow rays of OpenCL kernels and of compute shaders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..scene.color import luminance
from ..scene.light_groups import LightGroups
from ..scene.model import Light
from ..scene.triangles import Triangles
from ..settings import MOST_LIGHTS
from .emitters import EMITTER, SampledTriangles, lamp_records, sky_record, surface_records
from .modulation import pack_modulations
from .sky import Sky


class EmitterLists:
    """Emitter records of all sampled light: one list per light, one for surfaces, and one for a bright sky.

    modulations, profiles:  tables that the records refer to, see `modulation.pack_modulations`
    lists:                  (k,) EMITTER each
    """

    def __init__(
        self, lamps: Sequence[Light], triangles: Triangles, bright: SampledTriangles, sky: Sky
    ) -> None:
        self.modulations, self.profiles, numbers = pack_modulations(lamps)
        self.lists = [lamp_records(lamp, number) for lamp, number in zip(lamps, numbers, strict=True)]
        self.lists.append(surface_records(triangles, bright))
        if sky.bright is not None:
            self.lists.append(sky_record())
        self._mesh = triangles.mesh

    def by_group(self, groups: LightGroups) -> Iterator[list[np.ndarray]]:
        """Yield for each light group the lists, reduced to emitters of the group; some may be empty."""
        triangle = self.lists[len(groups.lamps)]["triangle"]
        numbers = (*groups.lamps, groups.meshes[self._mesh[triangle]], groups.world)
        for group in range(groups.count):
            yield [
                records[np.broadcast_to(number == group, len(records))]
                for records, number in zip(self.lists, numbers, strict=False)
            ]


def joined_emitters(lists: Sequence[np.ndarray], light_samples: int) -> tuple[np.ndarray, int] | None:
    """Join lists into one array, (m,) EMITTER; return it and the number of shadow rays per patch.

    Returns None if all lists are empty.

    light_samples:  shadow rays for each of the first MOST_LIGHTS lists; further lists share these rays
    """
    shining = [emitters for emitters in lists if len(emitters)]
    if not shining:
        return None
    return EMITTER.joined(shining), light_samples * min(len(shining), MOST_LIGHTS)


def visible_fraction(light: np.ndarray) -> np.ndarray:
    """Return the visible fraction of a light, (n,) float32: shadowed over unshadowed luminance.

    light:  (n, 4) float32, E/pi and its unshadowed luminance
    """
    fraction: np.ndarray = np.where(
        light[:, 3] > 0, luminance(light[:, :3]) / np.maximum(light[:, 3], 1e-30), 0
    )
    return np.minimum(fraction, 1).astype(np.float32)
