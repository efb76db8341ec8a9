"""Makes lightmap UVs for objects that have none, or whose modifiers make their UVs overlap."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial

import bpy

from ....engine.errors import SceneError
from ....engine.object_message import object_message
from ....engine.progress import Progress, finished
from ....engine.unwrap.segmentation import has_xatlas
from ...chart_settings import read_cutting
from ...lookup import find_all
from ...rollback import Rollback
from ..messages import WITHOUT_XATLAS, XATLAS_FAILED, Issues, no_space_message
from ..objects.evaluation import Evaluation, evaluate
from ..scene_context import SceneContext
from .atlas_members import AtlasMembers
from .object_lookup import MeshChangedError, ObjectLookup
from .pack_jobs import mip_width, squares_of
from .packed_page import PackedPage
from .packing_record import PackingRecord
from .target_reading import TargetReader, with_areas
from .unwrap_process import unwrap_in_process
from .uv_modifier import drop_uv_modifier, fits, uv_modifier
from .uv_node_group import NAME, remove_unused_uvs
from .uv_targets import UnwrapMesh, evaluated_mesh, evaluated_targets, may_lack_uvs, users_of_meshes
from .viewport_uvs import project_for_viewport

#: Attempts that run in slices and are restarted when a mesh changes; the attempt after them runs without
#: yielding.
_ATTEMPTS = 3


class UvAction(Enum):
    """Treatment of lightmap UVs that objects already have.

    NONE:     they stay as they are
    PACKING:  their charts are packed again
    CHARTS:   they are cut into new charts
    """

    NONE, PACKING, CHARTS = range(3)


@dataclass
class UnwrapSummary:
    """Outcome of unwrapping.

    objects:  objects that got lightmap UVs
    moved:    objects whose charts were repacked to make room for other objects
    skipped:  objects that need lightmap UVs but cannot have them
    issues:   sentences for the user about skipped objects
    notes:    all sentences for the user
    """

    objects: list[bpy.types.Object] = field(default_factory=list)
    moved: list[bpy.types.Object] = field(default_factory=list)
    skipped: list[bpy.types.Object] = field(default_factory=list)
    issues: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def unwrap_missing(
    context: SceneContext,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    changes: Rollback,
    action: UvAction = UvAction.NONE,
    movable: Sequence[bpy.types.Object] = (),
) -> Generator[Progress | None, None, UnwrapSummary]:
    """Give lightmap UVs to each object with faces that has none; runs in slices and returns a summary.

    The UVs go into a layer of the object's own mesh. Modifiers may copy or make faces, so that this layer
    overlaps or is missing on the evaluated mesh. In that case the evaluated mesh is unwrapped, and a last
    modifier stores its UVs. That modifier is made again once it no longer fits the evaluated mesh.

    All new UVs of an atlas are packed together for an image of `resolution` texels. If other objects use the
    atlas already, their charts are repacked with the new ones. If these may not be repacked, the new ones get
    another atlas. Other UV layers, the selection and the mode do not change. An object that cannot have UVs
    is skipped, with a note.

    Raises SceneError if the layer has no name or the scene was deleted. Datablocks are looked up again after
    each yield. Changes that need an undo step are made after the last yield, and the step must follow at
    once.

    action:   treatment of existing lightmap UVs
    movable:  objects whose charts may be repacked if their UVs are still as Hemibake made them
    """
    if not uv_layer:
        raise SceneError("The lightmap UV layer has no name. Type one, such as Lightmap.")
    uids = [obj.session_uid for obj in objects]
    free = frozenset(obj.session_uid for obj in movable)
    make = partial(_Unwrapping, context, uv_layer, resolution, changes, action, free)
    yield Progress("Unwrapping", 0.0)
    yield None
    for _ in range(_ATTEMPTS):
        try:
            return (yield from make().unwrap(uids))
        except MeshChangedError:
            yield None
    return finished(make().unwrap(uids))


class _Unwrapping:
    """Unwrapping of objects' own meshes, then of evaluated meshes whose modifiers make UVs overlap."""

    def __init__(
        self,
        context: SceneContext,
        uv_layer: str,
        resolution: int,
        changes: Rollback,
        action: UvAction,
        movable: frozenset[int],
    ) -> None:
        self._context, self._uv_layer, self._action = context, uv_layer, action
        self._resolution, self._changes = resolution, changes
        self._made, self._issues = UnwrapSummary(), Issues()
        self._left: list[int] = []
        self._failed: set[str] = set()
        self._moving: set[int] = set()
        self._objects = ObjectLookup()
        self._members = AtlasMembers(context, self._objects, uv_layer, movable)
        self._reader = TargetReader(context, self._objects, self._leave)
        self._packings = PackingRecord(context, resolution)

    def unwrap(self, uids: Sequence[int]) -> Generator[Progress | None, None, UnwrapSummary]:
        """Make all missing UVs, and note the objects that cannot have any."""
        # Changes before a yield are temporary: all of them are undone before the next yield.
        trial = Rollback()
        objects = self._prepare(uids, trial)
        users = users_of_meshes(objects, self._uv_layer, self._action is not UvAction.NONE)
        trial.undo()
        own = yield from self._reader.read(users, self._action is UvAction.PACKING)
        moving = yield from self._members.users_to_move(own)
        self._moving = {uid for users in moving for uid in users.uids}
        own += yield from self._reader.read(moving, keeps_charts=True)
        if self._action is UvAction.PACKING:
            own = yield from with_areas(own)
            if self._packings.is_current(own, self._reader.digests):
                return self._made
        pages = yield from self._pack(own)

        # Modifiers can be evaluated only after the objects' own meshes have got their UV layer.
        trial = Rollback()
        objects = self._prepare(uids, trial)
        self._store(pages, trial)
        evaluated = self._evaluated_targets(objects, own)
        if evaluated:
            trial.undo()
            stored = [target for page in pages for target in page.targets]
            pages = yield from self._pack([*_without(stored, evaluated), *evaluated])
            trial = Rollback()
            self._prepare(uids, trial)
            self._store(pages, trial)
        if self._action is not UvAction.NONE and self._left:
            trial.undo()
            raise SceneError(" ".join(self._issues.messages()))
        self._changes.add(trial.undo)
        self._packings.keep(pages, self._changes)
        project_for_viewport(self._context, find_all(bpy.data.objects, uids), self._uv_layer, self._changes)
        self._made.notes += self._members.leave_shared_atlases(pages, self._changes)
        self._finish(pages)
        return self._made

    def _prepare(self, uids: Sequence[int], changes: Rollback) -> list[bpy.types.Object]:
        """Write edit-mode changes to the meshes, remove outdated UV modifiers; return the objects."""
        remove_unused_uvs()
        self._context.view_layer.update()
        objects = find_all(bpy.data.objects, uids)
        for obj in objects:
            obj.update_from_editmode()
        kept = [(obj, modifier) for obj in objects if (modifier := uv_modifier(obj, self._uv_layer))]
        for obj in self._outdated([pair for pair in kept if pair[0].is_editable]):
            drop_uv_modifier(obj, self._uv_layer, changes)
        self._objects.look_up()
        return objects

    def _outdated(
        self, kept: Sequence[tuple[bpy.types.Object, bpy.types.Modifier]]
    ) -> list[bpy.types.Object]:
        """Return the objects whose UV modifier must be made again."""
        if self._action is not UvAction.NONE or not kept:
            return [obj for obj, _ in kept]
        return evaluate(
            self._context,
            lambda evaluation: [obj for obj, modifier in kept if _outdated(obj, modifier, evaluation)],
            [obj for obj, _ in kept],
        )

    def _evaluated_targets(
        self, objects: Sequence[bpy.types.Object], own: Sequence[UnwrapMesh]
    ) -> list[UnwrapMesh]:
        """Return the evaluated meshes of objects that need lightmap UVs in a UV modifier."""
        made = {self._objects[uid].data.session_uid for target in own for uid in target.uids}
        rest = [
            obj for obj in objects if obj.session_uid not in self._left and may_lack_uvs(obj, self._uv_layer)
        ]
        if not rest:
            return []
        return evaluate(
            self._context,
            lambda evaluation: evaluated_targets(rest, self._uv_layer, made, evaluation, self._leave),
            rest,
        )

    def _leave(self, obj: bpy.types.Object, issue: str) -> None:
        """Skip an object and record the reason for the user."""
        self._left.append(obj.session_uid)
        self._issues.add(issue, obj.name)

    def _pack(self, targets: Sequence[UnwrapMesh]) -> Generator[Progress | None, None, list[PackedPage]]:
        """Cut charts and pack them for each atlas and each shared mesh; return the pages."""
        if not targets:
            return []
        targets = yield from with_areas(targets)
        self._look_up(targets)
        properties, one_page = self._context.scene.hemibake, self._action is not UvAction.NONE
        squares, atlases = squares_of(
            targets, self._objects, self._uv_layer, self._resolution, properties, one_page
        )
        coarsest = mip_width(properties)
        meshes, charts = zip(*((target.mesh, target.charts) for target in targets), strict=True)
        unwrapped, failed = yield from unwrap_in_process(meshes, charts, squares, read_cutting(properties))
        self._failed.update(meshes[index].name for index in failed)
        yield Progress("Storing lightmap UVs", 1.0, 1.0)
        yield None
        cut = [replace(target, charts=made) for target, made in zip(targets, unwrapped.charts, strict=True)]
        self._look_up(cut)
        placed = {index for filled in unwrapped.squares for index in filled.meshes}
        needed = dict(unwrapped.too_small)
        for index, target in enumerate(cut):
            if index not in placed:
                for obj in self._objects.of(target.uids):
                    self._leave(obj, no_space_message(needed[index] * coarsest))
        return [
            PackedPage([cut[index] for index in filled.meshes], list(filled.uvs), atlases[filled.square])
            for filled in unwrapped.squares
        ]

    def _look_up(self, targets: Sequence[UnwrapMesh]) -> None:
        """Renew the references to the targets' objects; raises MeshChangedError if a mesh changed."""
        self._objects.look_up()
        for target in targets:
            objects = self._objects.of(target.uids)
            if target.topology is None:
                objects[0].update_from_editmode()
                if len(objects[0].data.loops) != len(target.mesh.corners):
                    raise MeshChangedError

    def _store(self, pages: Sequence[PackedPage], changes: Rollback) -> None:
        """Store the UVs of all pages in layers or UV modifiers."""
        for page in pages:
            page.store(self._objects, changes)

    def _finish(self, pages: Sequence[PackedPage]) -> None:
        """Fill the summary: objects with new UVs, repacked objects, skipped objects, and notes."""
        targets = [target for page in pages for target in page.targets]
        uids = list(dict.fromkeys(uid for target in targets for uid in target.uids))
        self._made.objects = self._objects.of(uid for uid in uids if uid not in self._moving)
        self._made.moved = self._objects.of(uid for uid in uids if uid in self._moving)
        self._made.skipped = self._objects.present(self._left)
        if targets and not has_xatlas():
            self._made.notes.append(WITHOUT_XATLAS)
        if self._failed:
            self._made.notes.append(object_message(XATLAS_FAILED, sorted(self._failed)))
        kept = sorted(self._objects[uid].name for target in targets if target.topology for uid in target.uids)
        if kept:
            sentence = (
                f"Modifiers of {{}} copy or create faces: a last modifier '{NAME}' stores their lightmap UVs."
            )
            self._made.notes.append(object_message(sentence, kept))
        self._made.issues = self._issues.messages()
        self._made.notes += self._made.issues


def _outdated(obj: bpy.types.Object, modifier: bpy.types.Modifier, evaluation: Evaluation) -> bool:
    """Return True if the evaluated mesh of an object no longer fits the UVs of its UV modifier."""
    with evaluated_mesh(obj, evaluation) as mesh:
        return mesh is not None and not fits(modifier, mesh)


def _without(targets: Sequence[UnwrapMesh], replaced: Sequence[UnwrapMesh]) -> list[UnwrapMesh]:
    """Return the targets, except those whose objects are all among the replacing targets."""
    gone = {uid for target in replaced for uid in target.uids}
    return [target for target in targets if any(uid not in gone for uid in target.uids)]
