"""A page of lightmap UVs: meshes whose charts are packed into one square."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...object_properties import set_property
from ...rollback import Rollback
from .object_lookup import ObjectLookup
from .uv_digest import digest_of
from .uv_layers import replace_layer
from .uv_modifier import add_uv_modifier
from .uv_targets import UnwrapMesh


@dataclass(frozen=True)
class PackedPage:
    """Meshes whose charts are packed into one square.

    targets:  the meshes
    uvs:      UVs of each mesh, (l, 2) float32 at its loops
    atlas:    name of the atlas; None for the tile of a mesh that several objects use
    """

    targets: list[UnwrapMesh]
    uvs: list[np.ndarray]
    atlas: str | None

    @property
    def uids(self) -> list[int]:
        """Session uids of the objects that use the meshes."""
        return [uid for target in self.targets for uid in target.uids]

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 digest of the UVs of each mesh, by the mesh's name."""
        pairs = zip(self.targets, self.uvs, strict=True)
        return {target.mesh.name: digest_of(uvs) for target, uvs in pairs}

    def store(self, objects: ObjectLookup, changes: Rollback) -> None:
        """Store the UVs in a layer of the objects' own mesh, or in a UV modifier for an evaluated mesh."""
        for target, uvs in zip(self.targets, self.uvs, strict=True):
            users = objects.of(target.uids)
            if target.topology is None:
                replace_layer(users[0], target.layer, uvs, changes)
                for obj in users:
                    set_property(obj, "generated_uvs", digest_of(uvs), changes)
            else:
                add_uv_modifier(users, uvs, target.topology, target.layer, changes)
