"""Records how each atlas was packed, so that an atlas with unchanged input is not packed again."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import partial

import bpy

from ...rollback import Rollback
from ..scene_context import SceneContext
from .packed_page import PackedPage
from .uv_targets import UnwrapMesh


class PackingRecord:
    """Stores in the scene's list of lightmaps a digest of the input of the last packing of each.

    resolution:  width of lightmaps, texels
    """

    def __init__(self, context: SceneContext, resolution: int) -> None:
        self._context, self._resolution = context, resolution

    def is_current(self, targets: Sequence[UnwrapMesh], digests: dict[str, str]) -> bool:
        """Return True if the meshes of an atlas are unchanged since the recorded packing, by digest.

        targets:  meshes of one atlas, with measured areas
        digests:  digest of the present UVs of each mesh, by the mesh's name
        """
        entry = self._entry(targets[0].atlas) if targets else None
        known = all(target.mesh.name in digests for target in targets)
        return entry is not None and known and entry.packing == self._digest(targets, digests)

    def keep(self, pages: Sequence[PackedPage], changes: Rollback) -> None:
        """Record the digest of the packing of each page with the page's atlas."""
        for page in pages:
            entry = self._entry(page.atlas)
            if entry is not None:
                name, before = entry.name, entry.packing
                changes.add(partial(self._set, name, before))
                entry.packing = self._digest(page.targets, page.digests)

    def _entry(self, atlas: str | None) -> bpy.types.PropertyGroup | None:
        """Return the entry of an atlas in the scene's list of lightmaps, None if the list has none."""
        return self._context.scene.hemibake.lightmaps.get(atlas) if atlas is not None else None

    def _set(self, name: str, packing: str) -> None:
        entry = self._entry(name)
        if entry is not None:
            entry.packing = packing

    def _digest(self, targets: Sequence[UnwrapMesh], digests: dict[str, str]) -> str:
        """Return the SHA-256 digest of the packing settings, and of each mesh's area fraction and UVs."""
        properties = self._context.scene.hemibake
        parts = [str(self._resolution), str(properties.padding), str(properties.mip_level)]
        parts.append(str(properties.align_charts))
        surface = max(sum(target.area for target in targets), 1e-300)
        for target in sorted(targets, key=lambda target: target.mesh.name):
            name = target.mesh.name
            parts += [name, f"{target.area / surface:.5f}", digests[name]]
        return hashlib.sha256("|".join(parts).encode()).hexdigest()
