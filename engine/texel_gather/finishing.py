"""Last steps of a bake: from values of patches and texel samples to the final images (VI.B)."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from concurrent.futures import Future

import numpy as np

from ..device.device_array import Values, channel_sums
from ..object_message import object_message
from ..outputs import is_light, is_of_light_group
from ..patches.patch_scene import PatchScene
from ..patches.seams import Seams
from ..plan.stages import BakeStages
from ..postprocess.blocked_seams import drop_blocked_seams
from ..postprocess.denoising import Denoising
from ..postprocess.directional_denoising import encode_signed_maps, restored_maps
from ..postprocess.final_lightmaps import FinalLightmaps
from ..postprocess.independent_estimate import IndependentEstimate
from ..postprocess.refined_texels import RefinedTexels
from ..postprocess.store import LightmapImages
from ..progress import Progress, run_as_fraction
from ..scene.model import Scene
from ..solve.solution import Solution
from .independent_gather import gather_independent_estimate
from .lit_back_faces import warn_lit_back_faces
from .texel_sample_gather import TexelSampleLight
from .texel_sample_points import TexelGatherJob

#: Fraction of its mean that is added to each map before division, so that texels where all groups are 0 get
#: finite shares.
_FAINT = 1e-7


class Finishing:
    """Final images from outputs: texel refinement, denoising, seam fit and fill.

    store:     images of the patch values
    texels:    input of the gather at texel samples
    solution:  solution of all light
    made:      (n, 3) or (n,) float32, values of each output at the patches, by name
    lit:       light at texel samples
    refined:   texel values from patches and texel samples
    """

    def __init__(
        self,
        store: LightmapImages,
        texels: TexelGatherJob,
        solution: Solution,
        made: Mapping[str, Values],
        lit: TexelSampleLight,
    ) -> None:
        self._store, self._job, self._texels, self._solution = store, texels.job, texels, solution
        self.made, self.lit = made, lit
        self.refined = self._refined_texels()
        self._denoising = Denoising(self.refined.known, self._job.settings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Messages for the user; warm starts skip an estimate that would delay each of their bakes."""
        scene, patch_scene, known = self._texels.scene, self._job.patch_scene, self.refined.known
        buried = warn_buried(scene, patch_scene, known)
        turned: list[str] = []
        if not self._job.settings.warm_start:
            turned = warn_lit_back_faces(scene, self._job, self._solution.light, len(known))
        return *self.lit.warnings, *buried, *turned, *self._denoising.warnings

    @property
    def reasons(self) -> tuple[str, ...]:
        """Sentences for the report."""
        return *self.lit.reasons, *self._denoising.reasons

    def images(
        self, stages: BakeStages, seams: Future[Seams] | None
    ) -> Generator[Progress, None, dict[str, np.ndarray]]:
        """Return the final images, (atlases, r, r, 3) float32, by name.

        seams:  pairs of points with equal light; None to leave seams visible
        """
        quiet: dict[str, np.ndarray] = {}
        if self._job.settings.denoise:
            quiet = yield from stages.run(stages.denoising, self._without_noise())
        yield stages.begin(stages.images)
        off_centre = unblocked = None
        if seams:
            off_centre = self._job.kept.texels.off_centre_patches(self._job.compute, self._job.patch_scene)
            unblocked = self._in_sight(seams.result())
        final = FinalLightmaps(self.refined, off_centre, unblocked)
        images = {name: final.image(image) for name, image in quiet.items()}
        left = {name: values for name, values in self.made.items() if name not in quiet}
        images |= final.images(left, self.lit.values)
        images = {name: images[name] for name in self.made}
        groups = {name: image for name, image in images.items() if is_of_light_group(name)}
        if groups:
            images |= scale_to_sum(groups, images["combined"])
        yield stages.end()
        return images

    def _without_noise(self) -> Generator[float, None, dict[str, np.ndarray]]:
        """Return denoised texel values, (atlases, r, r, 3) float32, by name; yield the fraction done.

        Covers light outputs and directional maps; empty if denoising fails.
        """
        texels, lit = self.refined, self.lit
        shown = {name: texels.values(values, lit.values.get(name)) for name, values in self.made.items()}
        normals = texels.values(self._job.patch_scene.geometry.normal, lit.normals)

        # Denoising uses an independent estimate to separate noise from detail.
        values, part = yield from run_as_fraction(
            0.0, 0.4, gather_independent_estimate(self._texels, self._solution)
        )
        seen = {name: self._store.image(light) for name, light in values.items()}
        again = IndependentEstimate(seen, texels.centres, part) if seen else None

        # Directional maps are encoded as light for the denoiser.
        names = [name for name in shown if is_light(name)]
        light = {name: shown[name] for name in names} | encode_signed_maps(shown)
        filtered = yield from run_as_fraction(0.4, 1.0, self._denoising.run(light, again))
        if filtered is light:
            return {}
        quiet = {name: filtered[name] for name in names}
        return quiet | restored_maps(shown, filtered, normals)

    def _in_sight(self, seams: Seams) -> Seams:
        """Return the seams that no geometry blocks."""
        if not self._job.rays.possible:
            return seams
        job, texels = self._job, self.refined
        light = texels.on_device(job.opencl, *self._light_of_texels())
        return drop_blocked_seams(seams, job.patch_scene, job.rays, light, texels.known, texels.invalid)

    def _refined_texels(self) -> RefinedTexels:
        """Return the texel values from patches, texel samples and the fit at thin walls."""
        lit, store = self.lit, self._store
        if not len(lit.samples):
            return RefinedTexels(store)
        compute = self._job.opencl
        refined = RefinedTexels(store, lit.means(compute, store.has_patch.shape), lit.invalid)
        if not len(lit.inside):
            return refined
        shown = refined.on_device(compute, *self._light_of_texels())
        return refined.with_walls(lit.beside_walls(compute, shown, refined.known))

    def _light_of_texels(self) -> tuple[Values, np.ndarray | None]:
        """Return E/pi, summed over the channels: of patches, (n, 1), and of samples, (s,), or None."""
        if not len(self.lit.samples):
            return channel_sums(self._solution.light), None
        return self.lit.centres, self.lit.light


def scale_to_sum(maps: dict[str, np.ndarray], combined: np.ndarray) -> dict[str, np.ndarray]:
    """Return the light group maps, (atlases, r, r, 3) float32 each, scaled so that their sum is `combined`.

    Each texel and channel of `combined` is divided in proportion to the groups' maps.
    """
    parts = {name: np.maximum(images, 0) for name, images in maps.items()}
    total = np.zeros_like(combined)
    for part in parts.values():
        part += (_FAINT * part.mean(axis=(0, 1, 2), dtype=np.float64)).astype(np.float32)
        total += part
    factor = np.divide(combined, total, out=np.zeros_like(total), where=total > 0)
    for part in parts.values():
        part *= factor
    return parts


_SENTENCE = (
    "{}: inside other geometry or under a touching face, so the lightmap shows the light around it. If it "
    "stands in a room, recalculate the normals of the room. Otherwise set its role to No Lightmap."
)

#: One row of this many is examined first, since most scenes have light on all objects (chosen).
_ROWS = 16


def warn_buried(scene: Scene, patch_scene: PatchScene, known: np.ndarray) -> list[str]:
    """Return a warning that names the objects without a texel of valid light.

    known:  (atlases, r, r) bool, texels with valid light
    """
    lit = _meshes_at(scene, patch_scene, known, slice(None, None, _ROWS))
    if all(lit[number] for number, mesh in enumerate(scene.meshes) if mesh.atlas < len(known)):
        return []
    shown, lit = (
        _meshes_at(scene, patch_scene, mask, slice(None)) for mask in (np.ones_like(known[:, :1]), known)
    )
    buried = np.flatnonzero(shown & ~lit)
    return [object_message(_SENTENCE, [scene.meshes[index].name for index in buried])] if len(buried) else []


def _meshes_at(scene: Scene, patch_scene: PatchScene, wanted: np.ndarray, rows: slice) -> np.ndarray:
    """Return a mask of the meshes with patches at wanted texels of some rows, (m,) bool.

    wanted:  (atlases, r, r) bool, or one row for all
    """
    found = np.zeros(len(scene.meshes), bool)
    for entries, mask in zip(patch_scene.texel_to_patch, wanted, strict=False):
        masks = np.broadcast_to(mask, entries.shape)[rows]
        for some, chosen in zip(entries[rows], masks, strict=True):
            patches = some[chosen & (some > 0)] - 1
            found[patch_scene.triangles.mesh[patch_scene.patches.triangle[patches]]] = True
    return found
