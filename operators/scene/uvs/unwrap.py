"""Lightmap UVs for objects that have none, or whose modifiers spoil them."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field

import bpy
import numpy as np

from ....engine.errors import SceneError
from ....engine.naming import naming
from ....engine.progress import Progress
from ...changes import Changes
from ...lookup import find, find_all
from ..messages import NO_ROOM, WITHOUT_XATLAS, Troubles
from ..scene_context import SceneContext
from .charts import destroy_atlases, has_xatlas, pack_charts
from .multi_user import instanced_objects, multi_user_sources
from .uv_layers import add_layer, remove_layer
from .uv_modifier import (
    NAME,
    add_uv_modifier,
    drop_uv_modifier,
    fits,
    has_uvs,
    remove_unused_uvs,
    uv_modifier,
)
from .uv_targets import Target, evaluated_mesh, evaluated_targets, own_targets


@dataclass
class Made:
    """What unwrapping did.

    objects  those that have got lightmap UVs
    skipped  those that need UVs but cannot have them
    notes    sentences for the user
    """

    objects: list[bpy.types.Object] = field(default_factory=list)
    skipped: list[bpy.types.Object] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def unwrap_missing(
    context: SceneContext,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    changes: Changes,
) -> Generator[Progress | None, None, Made]:
    """Give lightmap UVs to each object with faces that has none, in slices; return what was done.

    Raises SceneError without a layer's name, or once the scene is gone. Datablocks are looked up again
    after each yield, and what needs an undo step is made after the last one, which must follow at once.

    An object's own mesh gets a layer. Where modifiers copy or make faces, so that the layer overlaps or is
    missing on what they make, this is unwrapped instead and a last modifier keeps the UVs; it is made
    anew once it no longer fits. All new UVs of an atlas are packed together, for an image of `resolution`
    texels. If other objects hold that atlas already, the new ones move to a fresh atlas. Other UV layers,
    the selection and the mode stay as they are. An object that cannot have UVs is skipped, with a note.
    """
    if not uv_layer:
        raise SceneError("The lightmap UV layer has no name. Type one, such as Lightmap.")
    uids = [obj.session_uid for obj in objects]
    yield Progress("Unwrapping", 0.0)
    yield None
    unwrapping = _Unwrapping(context, uv_layer, resolution, changes)
    present = find_all(bpy.data.objects, uids)
    unwrapping.prepare(present)
    try:
        return unwrapping.unwrap(present)
    finally:
        destroy_atlases()


class _Unwrapping:
    """Unwraps objects' own meshes first, then what modifiers make where that did not do."""

    def __init__(self, context: SceneContext, uv_layer: str, resolution: int, changes: Changes) -> None:
        self._context, self._uv_layer = context, uv_layer
        self._resolution, self._changes = resolution, changes
        self._made, self._troubles = Made(), Troubles()

    def prepare(self, objects: Sequence[bpy.types.Object]) -> None:
        """Take edited meshes as they are, and drop modifiers whose UVs fit no longer."""
        remove_unused_uvs()
        self._context.view_layer.update()
        for obj in objects:
            obj.update_from_editmode()
        kept = [(obj, modifier) for obj in objects if (modifier := uv_modifier(obj, self._uv_layer))]
        depsgraph = self._context.evaluated_depsgraph_get()
        outdated = [obj for obj, modifier in kept if obj.is_editable and _outdated(obj, modifier, depsgraph)]
        for obj in outdated:
            drop_uv_modifier(obj, self._uv_layer, self._changes)

    def unwrap(self, objects: Sequence[bpy.types.Object]) -> Made:
        """Make all UVs that are missing; warn where they cannot be as usual."""
        own = own_targets(objects, self._uv_layer, self._leave)
        pages = self._store(own)
        made = {obj.data.session_uid for target in own for obj in target.objects}
        left = {obj.session_uid for obj in self._made.skipped}
        rest = [obj for obj in objects if obj.session_uid not in left]
        depsgraph = self._context.evaluated_depsgraph_get()
        evaluated = evaluated_targets(rest, self._uv_layer, made, depsgraph, self._leave)
        if evaluated:
            stored = [target for page in pages for target in page.targets]
            for target in stored:
                remove_layer(target.objects[0], target.layer)
            pages = self._store([*_without(stored, evaluated), *evaluated])
        self._leave_atlases(pages)
        self._finish(pages)
        return self._made

    def _leave(self, obj: bpy.types.Object, trouble: str) -> None:
        """Let an object go without lightmap UVs."""
        self._made.skipped.append(obj)
        self._troubles.add(trouble, obj.name)

    def _store(self, targets: Sequence[Target]) -> list[_Page]:
        """Pack the charts of each atlas and store the UVs; return what lies together."""
        multi_user, instanced = multi_user_sources(self._uv_layer), instanced_objects()
        pages = []
        for atlas, members in _by_atlas(targets).items():
            tiled = [target for target in members if _is_multi_user(target, multi_user, instanced)]
            alone = [target for target in members if not _is_multi_user(target, multi_user, instanced)]
            area = sum(target.area for target in members)
            pages += self._pack(alone, atlas, self._resolution)
            for target in tiled:
                width = _tile_width(target.area, area, self._resolution)
                pages += self._pack([target], None, width)
        return pages

    def _pack(self, targets: Sequence[Target], atlas: str | None, resolution: int) -> list[_Page]:
        """Store UVs such that targets lie side by side, on several pages if one has no room for all."""
        if not targets:
            return []
        meshes, charts = zip(*((target.mesh, target.charts) for target in targets), strict=True)
        packed = pack_charts(meshes, charts, resolution)
        if packed is not None:
            for target, uvs in zip(targets, packed, strict=True):
                self._keep(target, uvs)
            return [_Page(list(targets), atlas)]
        if len(targets) == 1:
            for obj in targets[0].objects:
                self._leave(obj, NO_ROOM)
            return []
        ordered = sorted(targets, key=lambda target: -target.area)
        half = len(ordered) // 2
        return [
            page for part in (ordered[:half], ordered[half:]) for page in self._pack(part, atlas, resolution)
        ]

    def _keep(self, target: Target, uvs: np.ndarray) -> None:
        """Store the UVs of a target's loops, (l, 2)."""
        if target.topology is None:
            add_layer(target.objects[0], target.layer, uvs, self._changes)
        else:
            add_uv_modifier(target.objects, uvs, target.topology, target.layer, self._changes)

    def _leave_atlases(self, pages: Sequence[_Page]) -> None:
        """Let newly unwrapped objects leave an atlas that holds other ones."""
        taken = {obj.hemibake.atlas for obj in bpy.data.objects}
        full = self._atlases_of_others({obj.session_uid for page in pages for obj in page.objects})
        for page in pages:
            if page.atlas in full:
                fresh = next(
                    name for number in range(1, 10**6) if (name := f"{page.atlas}.{number:03d}") not in taken
                )
                taken.add(fresh)
                self._move(page.objects, page.atlas, fresh)
            elif page.atlas is not None:
                full.add(page.atlas)

    def _atlases_of_others(self, members: set[int]) -> set[str]:
        """Return the atlases of objects that had lightmap UVs before."""
        others = [obj for obj in self._context.scene.objects if obj.type == "MESH"]
        return {
            obj.hemibake.atlas
            for obj in others
            if obj.session_uid not in members and has_uvs(obj, self._uv_layer)
        }

    def _move(self, objects: Sequence[bpy.types.Object], atlas: str, fresh: str) -> None:
        """Let objects go to another atlas."""
        for obj in objects:
            self._changes.add(lambda uid=obj.session_uid: _set_atlas(uid, atlas))
            obj.hemibake.atlas = fresh
        sentence = f"New lightmap UVs were made for {{}}: they have the lightmap '{fresh}'."
        self._made.notes.append(naming(sentence, [obj.name for obj in objects]))

    def _finish(self, pages: Sequence[_Page]) -> None:
        """Say who has got UVs, and who has none."""
        targets = [target for page in pages for target in page.targets]
        self._made.objects = list(dict.fromkeys(obj for target in targets for obj in target.objects))
        if targets and not has_xatlas():
            self._made.notes.append(WITHOUT_XATLAS)
        kept = sorted(obj.name for target in targets if target.topology for obj in target.objects)
        if kept:
            sentence = (
                f"Modifiers of {{}} copy or make faces: a last modifier '{NAME}' keeps lightmap UVs of these."
            )
            self._made.notes.append(naming(sentence, kept))
        self._made.notes += self._troubles.tell()


@dataclass(frozen=True)
class _Page:
    """Targets whose charts lie side by side, in an atlas; None for a square of their own."""

    targets: list[Target]
    atlas: str | None

    @property
    def objects(self) -> list[bpy.types.Object]:
        return [obj for target in self.targets for obj in target.objects]


def _outdated(obj: bpy.types.Object, modifier: bpy.types.Modifier, depsgraph: bpy.types.Depsgraph) -> bool:
    """Return whether what an object's modifiers make has changed since its UVs were made."""
    with evaluated_mesh(obj, depsgraph) as mesh:
        return mesh is not None and not fits(modifier, mesh)


def _by_atlas(targets: Sequence[Target]) -> dict[str, list[Target]]:
    groups: dict[str, list[Target]] = {}
    for target in targets:
        groups.setdefault(target.atlas, []).append(target)
    return groups


def _without(targets: Sequence[Target], replaced: Sequence[Target]) -> list[Target]:
    """Return the targets that have an object which no other target has replaced."""
    gone = {obj.session_uid for target in replaced for obj in target.objects}
    return [target for target in targets if any(obj.session_uid not in gone for obj in target.objects)]


def _is_multi_user(target: Target, multi_user: set[int], instanced: set[int]) -> bool:
    """Return whether several objects, or instances, may show a mesh, which then gets a square to itself."""
    first = target.objects[0]
    if target.topology is None:
        return first.data.session_uid in multi_user
    return len(target.objects) > 1 or first.session_uid in instanced


def _tile_width(area: float, total: float, resolution: int) -> int:
    """Return about how many texels wide the tile of a mesh will be."""
    scale = np.sqrt(area / total) if total > 0 else 1.0
    return int(np.clip(resolution * scale, min(64, resolution), resolution))


def _set_atlas(uid: int, atlas: str) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        obj.hemibake.atlas = atlas
