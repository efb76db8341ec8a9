"""How atlases have been packed: one that would come out the same is left alone."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import bpy

from ...rollback import Rollback
from ..scene_context import SceneContext
from .packed_page import PackedPage
from .uv_targets import UnwrapMesh


class PackingRecord:
    """Keeps in the scene's list of lightmaps how each has been packed last.

    resolution  width of lightmaps, texels
    """

    def __init__(self, context: SceneContext, resolution: int) -> None:
        self._context, self._resolution = context, resolution

    def is_current(self, targets: Sequence[UnwrapMesh], digests: dict[str, str]) -> bool:
        """Return whether the atlas of targets, with their areas, still is as it was packed last.

        digests: of the UVs that they have, by the mesh's name
        """
        entry = self._entry(targets[0].atlas) if targets else None
        known = all(target.mesh.name in digests for target in targets)
        return entry is not None and known and entry.packing == self._digest(targets, digests)

    def keep(self, pages: Sequence[PackedPage], changes: Rollback) -> None:
        """Keep with the atlas of each page how it has been packed now."""
        for page in pages:
            entry = self._entry(page.atlas)
            if entry is not None:
                name, before = entry.name, entry.packing
                changes.add(lambda name=name, before=before: self._set(name, before))
                entry.packing = self._digest(page.targets, page.digests)

    def _entry(self, atlas: str | None) -> bpy.types.PropertyGroup | None:
        """Return the atlas of a name in the scene's list, None if it is not there."""
        return self._context.scene.hemibake.lightmaps.get(atlas) if atlas is not None else None

    def _set(self, name: str, packing: str) -> None:
        entry = self._entry(name)
        if entry is not None:
            entry.packing = packing

    def _digest(self, targets: Sequence[UnwrapMesh], digests: dict[str, str]) -> str:
        """Return a text that tells how charts are packed, for which surfaces, and to which sizes."""
        properties = self._context.scene.hemibake
        parts = [str(self._resolution), str(properties.padding), str(properties.mip_level)]
        parts.append(str(properties.align_charts))
        surface = max(sum(target.area for target in targets), 1e-300)
        for target in sorted(targets, key=lambda target: target.mesh.name):
            name = target.mesh.name
            parts += [name, f"{target.area / surface:.5f}", digests[name]]
        return hashlib.sha256("|".join(parts).encode()).hexdigest()
