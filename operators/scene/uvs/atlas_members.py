"""Repacks the earlier objects of an atlas with newly unwrapped ones, or gives these another atlas."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import bpy

from ....engine.object_message import object_message
from ...object_properties import set_property
from ...rollback import Rollback
from ..scene_context import SceneContext
from .known_charts import is_made
from .lightmap_layer import lightmap_layer
from .multi_user import multi_user_sources
from .object_lookup import ObjectLookup
from .packed_page import PackedPage
from .uv_modifier import has_uvs, uv_modifier, uv_source
from .uv_targets import UnwrapMesh, Users


class AtlasMembers:
    """Search for objects whose lightmap UVs were in an atlas before other objects got UVs there.

    movable:  session uids of objects whose charts may be repacked if their UVs are still as Hemibake made
              them
    """

    def __init__(
        self, context: SceneContext, objects: ObjectLookup, uv_layer: str, movable: frozenset[int]
    ) -> None:
        self._context, self._objects = context, objects
        self._uv_layer, self._movable = uv_layer, movable

    def users_to_move(self, fresh: Sequence[UnwrapMesh]) -> Generator[None, None, list[Users]]:
        """Return the users of the meshes that must be repacked together with the new meshes of their atlas.

        An atlas is repacked with all its earlier objects, or with none of them if one may not be repacked.
        Objects whose mesh has a tile of its own are not counted. Raises MeshChangedError if an object is
        gone.
        """
        multi_user = multi_user_sources(self._uv_layer)
        others: dict[str, list[int]] = {target.atlas: [] for target in fresh}
        for obj in self._without({uid for target in fresh for uid in target.uids}):
            if obj.hemibake.atlas in others and uv_source(obj, self._uv_layer) not in multi_user:
                others[obj.hemibake.atlas].append(obj.session_uid)
        users: list[Users] = []
        for members in others.values():
            found: list[Users] = []
            for uid in members:
                yield from self._objects.pause()
                obj = self._objects[uid]
                if not self._may_move(obj):
                    break
                found.append(Users((uid,), lightmap_layer(obj, self._uv_layer)))
            else:
                users += found
        return users

    def leave_shared_atlases(self, pages: Sequence[PackedPage], changes: Rollback) -> list[str]:
        """Give new objects another atlas if other objects, or an earlier page, use their atlas.

        Return notes.
        """
        taken = {obj.hemibake.atlas for obj in bpy.data.objects}
        full = {obj.hemibake.atlas for obj in self._without({uid for page in pages for uid in page.uids})}
        notes: list[str] = []
        for page in pages:
            if page.atlas in full:
                fresh = next(
                    name for number in range(1, 10**6) if (name := f"{page.atlas}.{number:03d}") not in taken
                )
                taken.add(fresh)
                objects = self._objects.of(page.uids)
                for obj in objects:
                    set_property(obj, "atlas", fresh, changes)
                sentence = f"New lightmap UVs were made for {{}}, in the lightmap '{fresh}'."
                notes.append(object_message(sentence, [obj.name for obj in objects]))
            elif page.atlas is not None:
                full.add(page.atlas)
        return notes

    def _without(self, fresh: set[int]) -> list[bpy.types.Object]:
        """Return the scene's mesh objects with lightmap UVs, except those whose session uids are `fresh`."""
        meshes = [obj for obj in self._context.scene.objects if obj.type == "MESH"]
        return [obj for obj in meshes if obj.session_uid not in fresh and has_uvs(obj, self._uv_layer)]

    def _may_move(self, obj: bpy.types.Object) -> bool:
        """Return True if an object's UVs are in its own mesh and unchanged since Hemibake made them."""
        own = obj.data.is_editable and uv_modifier(obj, self._uv_layer) is None
        movable = own and obj.session_uid in self._movable
        return movable and is_made([obj], lightmap_layer(obj, self._uv_layer))
