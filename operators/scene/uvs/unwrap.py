"""Lightmap UVs for objects that have none, or whose modifiers spoil them."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import bpy
import numpy as np

from ....engine.errors import SceneError
from ....engine.naming import naming
from ....engine.progress import Progress, finished
from ....engine.unwrap.polygon_mesh import PolygonMesh, areas
from ....engine.unwrap.segmentation import has_xatlas
from ....engine.unwrap.unwrapping import Square
from ...changes import Changes
from ...chart_settings import read_cutting
from ...lookup import find, find_all
from ..messages import WITHOUT_XATLAS, XATLAS_FAILED, Troubles, no_room
from ..objects.visible import visible_objects
from ..scene_context import SceneContext
from ..slices import row_slices
from .known_charts import digest_of, is_made, known_charts, layer_uvs
from .lightmap_layer import lightmap_layer
from .multi_user import instanced_objects, multi_user_sources
from .unwrap_process import unwrap_apart
from .uv_layers import replace_layer
from .uv_modifier import add_uv_modifier, drop_uv_modifier, fits, has_uvs, uv_modifier, uv_source
from .uv_node_group import NAME, remove_unused_uvs
from .uv_targets import Target, Users, evaluated_mesh, evaluated_targets, own_target, users_of_meshes
from .wall_cuts import loops_along_walls, walls_of

#: Longest time that meshes are read before a window has its turn, s.
_SLICE = 0.015

#: Unwrappings of meshes that change meanwhile, before it is done in one piece.
_ATTEMPTS = 3


class Anew(Enum):
    """What is done with the lightmap UVs that objects have: nothing, packed again, or made anew."""

    NONE, PACKING, CHARTS = range(3)


@dataclass
class Made:
    """What unwrapping did.

    objects  those that have got lightmap UVs
    moved    those whose charts were packed again to make room for others
    skipped  those that need UVs but cannot have them
    notes    sentences for the user
    """

    objects: list[bpy.types.Object] = field(default_factory=list)
    moved: list[bpy.types.Object] = field(default_factory=list)
    skipped: list[bpy.types.Object] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def unwrap_missing(
    context: SceneContext,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    changes: Changes,
    anew: Anew = Anew.NONE,
    movable: Sequence[bpy.types.Object] = (),
) -> Generator[Progress | None, None, Made]:
    """Give lightmap UVs to each object with faces that has none, in slices; return what was done.

    Raises SceneError without a layer's name, or once the scene is gone. Datablocks are looked up again
    after each yield, and what needs an undo step is made after the last one, which must follow at once.

    An object's own mesh gets a layer. Where modifiers copy or make faces, so that the layer overlaps or is
    missing on what they make, this is unwrapped instead and a last modifier keeps the UVs; it is made
    anew once it no longer fits. All new UVs of an atlas are packed together, for an image of `resolution`
    texels. If other objects hold that atlas already, their charts are packed again with the new ones; where
    that may not be, the new ones move to a fresh atlas. Other UV layers, the selection and the mode stay as
    they are. An object that cannot have UVs is skipped, with a note.

    anew     what is done with the UVs that objects have
    movable  objects whose charts may be packed again, if their UVs are as they were made
    """
    if not uv_layer:
        raise SceneError("The lightmap UV layer has no name. Type one, such as Lightmap.")
    uids = [obj.session_uid for obj in objects]
    free = frozenset(obj.session_uid for obj in movable)
    make = lambda: _Unwrapping(context, uv_layer, resolution, changes, anew, free)  # noqa: E731
    yield Progress("Unwrapping", 0.0)
    yield None
    for _ in range(_ATTEMPTS):
        try:
            return (yield from make().unwrap(uids))
        except _MeshChangedError:
            yield None
    return finished(make().unwrap(uids))


class _MeshChangedError(Exception):
    """An object is gone, or its faces are others, since its mesh was read."""


class _Unwrapping:
    """Unwraps objects' own meshes first, then what modifiers make where that did not do."""

    def __init__(
        self,
        context: SceneContext,
        uv_layer: str,
        resolution: int,
        changes: Changes,
        anew: Anew,
        movable: frozenset[int],
    ) -> None:
        self._context, self._uv_layer = context, uv_layer
        self._anew, self._movable = anew, movable
        self._resolution, self._changes = resolution, changes
        self._made, self._troubles = Made(), Troubles()
        self._left: list[int] = []
        self._failed: set[str] = set()
        self._digests: dict[str, str] = {}
        self._moving: set[int] = set()
        self._began = time.perf_counter()
        self._objects: dict[int, bpy.types.Object] = {}

    def unwrap(self, uids: Sequence[int]) -> Generator[Progress | None, None, Made]:
        """Make all UVs that are missing; warn where they cannot be as usual."""
        # Nothing of the scene is changed before a yield, or all is taken back.
        trial = Changes()
        objects = self._prepare(uids, trial)
        users = users_of_meshes(objects, self._uv_layer, self._anew is not Anew.NONE)
        trial.take_back()
        own = yield from self._read(users, self._anew is Anew.PACKING)
        moving = yield from self._users_to_move(own)
        self._moving = {uid for users in moving for uid in users.uids}
        own += yield from self._read(moving, keeps_charts=True)
        if self._anew is Anew.PACKING:
            own = yield from self._measured(own)
            if self._is_packed(own):
                return self._made
        pages = yield from self._pack(own)

        # What modifiers make is known only once the objects' own meshes have their layer.
        trial = Changes()
        objects = self._prepare(uids, trial)
        self._store(pages, trial)
        evaluated = self._evaluated_targets(objects, own)
        if evaluated:
            trial.take_back()
            stored = [target for page in pages for target in page.targets]
            pages = yield from self._pack([*_without(stored, evaluated), *evaluated])
            trial = Changes()
            self._prepare(uids, trial)
            self._store(pages, trial)
        if self._anew is not Anew.NONE and self._left:
            trial.take_back()
            raise SceneError(" ".join(self._troubles.tell()))
        self._changes.add(trial.take_back)
        self._remember_packing(pages)
        self._leave_atlases(pages)
        self._finish(pages)
        return self._made

    def _prepare(self, uids: Sequence[int], changes: Changes) -> list[bpy.types.Object]:
        """Return the objects, edited meshes as they are, without modifiers whose UVs fit no longer."""
        remove_unused_uvs()
        self._context.view_layer.update()
        objects = find_all(bpy.data.objects, uids)
        for obj in objects:
            obj.update_from_editmode()
        kept = [(obj, modifier) for obj in objects if (modifier := uv_modifier(obj, self._uv_layer))]
        depsgraph = self._context.evaluated_depsgraph_get()
        outdated = [
            obj
            for obj, modifier in kept
            if obj.is_editable and (self._anew is not Anew.NONE or _outdated(obj, modifier, depsgraph))
        ]
        for obj in outdated:
            drop_uv_modifier(obj, self._uv_layer, changes)
        self._objects = {obj.session_uid: obj for obj in bpy.data.objects}
        self._began = time.perf_counter()
        return objects

    def _users_to_move(self, own: Sequence[Target]) -> Generator[Progress | None, None, list[Users]]:
        """Return the users of meshes that are packed again with new ones of their atlas.

        Of an atlas all are, or none: those with tiles do not count.
        """
        fresh, multi_user = {uid for target in own for uid in target.uids}, multi_user_sources(self._uv_layer)
        others: dict[str, list[int]] = {target.atlas: [] for target in own}
        for obj in self._holders(fresh):
            if obj.hemibake.atlas in others and uv_source(obj, self._uv_layer) not in multi_user:
                others[obj.hemibake.atlas].append(obj.session_uid)
        users: list[Users] = []
        for members in others.values():
            found: list[Users] = []
            for uid in members:
                yield from self._pause()
                obj = self._objects.get(uid)
                if obj is None:
                    raise _MeshChangedError
                if not self._may_move(obj):
                    break
                found.append(Users((uid,), lightmap_layer(obj, self._uv_layer)))
            else:
                users += found
        return users

    def _pause(self) -> Generator[None, None, None]:
        """Give a window its turn if the last one is long ago, and look objects up again."""
        if time.perf_counter() - self._began > _SLICE:
            yield None
            self._began = time.perf_counter()
            self._objects = {obj.session_uid: obj for obj in bpy.data.objects}

    def _may_move(self, obj: bpy.types.Object) -> bool:
        """Return whether the charts of an object may be packed again: its own UVs, as they were made."""
        own = obj.data.is_editable and uv_modifier(obj, self._uv_layer) is None
        return (
            own and obj.session_uid in self._movable and is_made([obj], lightmap_layer(obj, self._uv_layer))
        )

    def _read(
        self, users: Sequence[Users], keeps_charts: bool
    ) -> Generator[Progress | None, None, list[Target]]:
        """Read meshes, a few at a time, with the charts that they have if these are kept."""
        targets = []
        for mesh in users:
            yield from self._pause()
            if not self._objects.keys() >= set(mesh.uids):
                raise _MeshChangedError
            objects = [self._objects[uid] for uid in mesh.uids]
            target = own_target(objects, mesh.layer, self._leave)
            if target is not None:
                if keeps_charts and mesh.layer in objects[0].data.uv_layers:
                    uvs = layer_uvs(objects[0].data, mesh.layer)
                    target = replace(target, charts=known_charts(target.mesh, uvs))
                    self._digests[target.mesh.name] = digest_of(uvs)
                elif objects[0].hemibake.cut_along_walls:
                    target = replace(target, mesh=self._parted(objects[0], target.mesh))
                targets.append(target)
        return targets

    def _parted(self, obj: bpy.types.Object, mesh: PolygonMesh) -> PolygonMesh:
        """Return an object's mesh, parted along walls that stand on its edges."""
        others = [other for other in visible_objects(self._context) if other != obj]
        walls = walls_of(others, self._context.evaluated_depsgraph_get())
        return replace(mesh, parted=loops_along_walls(obj, mesh, walls))

    def _measured(self, targets: Sequence[Target]) -> Generator[Progress | None, None, list[Target]]:
        """Return targets with their areas, some triangles at a time."""
        measured, began = [], time.perf_counter()
        for target in targets:
            mesh, area = target.mesh, 0.0
            if target.area > 0:
                measured.append(target)
                continue
            for rows in row_slices(len(mesh.triangles), 27):
                if time.perf_counter() - began > _SLICE:
                    yield None
                    began = time.perf_counter()
                area += float(areas(mesh.positions[mesh.corners[mesh.triangles[rows]]]).sum())
            measured.append(replace(target, area=area))
        return measured

    def _evaluated_targets(self, objects: Sequence[bpy.types.Object], own: Sequence[Target]) -> list[Target]:
        """Return what modifiers make such that it needs UVs of its own."""
        made = {self._objects[uid].data.session_uid for target in own for uid in target.uids}
        rest = [obj for obj in objects if obj.session_uid not in self._left]
        depsgraph = self._context.evaluated_depsgraph_get()
        return evaluated_targets(rest, self._uv_layer, made, depsgraph, self._leave)

    def _leave(self, obj: bpy.types.Object, trouble: str) -> None:
        """Let an object go without lightmap UVs."""
        self._left.append(obj.session_uid)
        self._troubles.add(trouble, obj.name)

    def _pack(self, targets: Sequence[Target]) -> Generator[Progress | None, None, list[_Page]]:
        """Lay the charts of each atlas, and of each mesh that several show, side by side."""
        if not targets:
            return []
        targets = yield from self._measured(targets)
        self._look_up(targets)
        squares, atlases = self._squares(targets)
        meshes, charts = zip(*((target.mesh, target.charts) for target in targets), strict=True)
        unwrapped, failed = yield from unwrap_apart(
            meshes, charts, squares, read_cutting(self._context.scene.hemibake)
        )
        self._failed.update(meshes[index].name for index in failed)
        yield Progress("Storing lightmap UVs", 1.0, 1.0)
        yield None
        cut = [replace(target, charts=made) for target, made in zip(targets, unwrapped.charts, strict=True)]
        self._look_up(cut)
        pages = [
            _Page([cut[index] for index in filled.meshes], list(filled.uvs), atlases[filled.square])
            for filled in unwrapped.squares
        ]
        placed = {index for filled in unwrapped.squares for index in filled.meshes}
        needed = dict(unwrapped.too_small)
        for index, target in enumerate(cut):
            if index not in placed:
                for uid in target.uids:
                    self._leave(self._objects[uid], no_room(needed[index] * self._mip_width))
        return pages

    def _squares(self, targets: Sequence[Target]) -> tuple[list[Square], list[str | None]]:
        """Return what has to lie side by side, and the atlas of each; None for a square of its own."""
        multi_user, instanced = multi_user_sources(self._uv_layer), instanced_objects()
        squares: list[Square] = []
        atlases: list[str | None] = []
        properties = self._context.scene.hemibake
        self._mip_width = 1 << properties.mip_level
        resolution = max(self._resolution // self._mip_width, 1)
        align = properties.align_charts
        pages, density = (1, 0.0) if self._anew is not Anew.NONE else spread(properties)
        for atlas, members in _by_atlas(targets).items():
            tiled = [index for index in members if self._is_multi_user(targets[index], multi_user, instanced)]
            alone = tuple(index for index in members if index not in tiled)
            area = sum(targets[index].area for index in members)
            if alone:
                wanted = density / self._mip_width
                squares.append(Square(alone, resolution, properties.padding, pages, wanted, align))
                atlases.append(atlas)
            for index in tiled:
                width = _tile_width(targets[index].area, area, resolution)
                squares.append(Square((index,), width, properties.padding, align=align))
                atlases.append(None)
        return squares, atlases

    def _is_multi_user(self, target: Target, multi_user: set[int], instanced: set[int]) -> bool:
        """Return whether several objects, or instances, may show a mesh, which gets a square to itself."""
        first = self._objects[target.uids[0]]
        if target.topology is None:
            return first.data.session_uid in multi_user
        return len(target.uids) > 1 or first.session_uid in instanced

    def _look_up(self, targets: Sequence[Target]) -> None:
        """Find the objects of targets again; raise _MeshChangedError if their meshes are others."""
        self._objects = {obj.session_uid: obj for obj in bpy.data.objects}
        for target in targets:
            objects = [self._objects.get(uid) for uid in target.uids]
            if None in objects:
                raise _MeshChangedError
            if target.topology is None:
                objects[0].update_from_editmode()
                if len(objects[0].data.loops) != len(target.mesh.corners):
                    raise _MeshChangedError

    def _store(self, pages: Sequence[_Page], changes: Changes) -> None:
        """Store the UVs of all pages."""
        for page in pages:
            for target, uvs in zip(page.targets, page.uvs, strict=True):
                objects = [self._objects[uid] for uid in target.uids]
                if target.topology is None:
                    replace_layer(objects[0], target.layer, uvs, changes)
                    for obj in objects:
                        _remember_made(obj, digest_of(uvs), changes)
                else:
                    add_uv_modifier(objects, uvs, target.topology, target.layer, changes)

    def _leave_atlases(self, pages: Sequence[_Page]) -> None:
        """Let newly unwrapped objects leave an atlas that holds other ones."""
        taken = {obj.hemibake.atlas for obj in bpy.data.objects}
        full = self._atlases_of_others({uid for page in pages for uid in page.uids})
        for page in pages:
            if page.atlas in full:
                fresh = next(
                    name for number in range(1, 10**6) if (name := f"{page.atlas}.{number:03d}") not in taken
                )
                taken.add(fresh)
                self._move([self._objects[uid] for uid in page.uids], page.atlas, fresh)
            elif page.atlas is not None:
                full.add(page.atlas)

    def _atlases_of_others(self, members: set[int]) -> set[str]:
        """Return the atlases of objects that had lightmap UVs before."""
        return {obj.hemibake.atlas for obj in self._holders(members)}

    def _holders(self, members: set[int]) -> list[bpy.types.Object]:
        """Return the other objects of the scene that have lightmap UVs."""
        meshes = [obj for obj in self._context.scene.objects if obj.type == "MESH"]
        return [obj for obj in meshes if obj.session_uid not in members and has_uvs(obj, self._uv_layer)]

    def _move(self, objects: Sequence[bpy.types.Object], atlas: str, fresh: str) -> None:
        """Let objects go to another atlas."""
        for obj in objects:
            self._changes.add(lambda uid=obj.session_uid: _set_atlas(uid, atlas))
            obj.hemibake.atlas = fresh
        sentence = f"New lightmap UVs were made for {{}}: they have the lightmap '{fresh}'."
        self._made.notes.append(naming(sentence, [obj.name for obj in objects]))

    def _is_packed(self, own: Sequence[Target]) -> bool:
        """Return whether an atlas still is as it was packed last."""
        entry = self._entry(own[0].atlas) if own else None
        known = all(target.mesh.name in self._digests for target in own)
        return entry is not None and known and entry.packing == self._packing(own, self._digests)

    def _remember_packing(self, pages: Sequence[_Page]) -> None:
        """Keep with each atlas how it has been packed."""
        for page in pages:
            entry = self._entry(page.atlas)
            if entry is not None:
                name, before = entry.name, entry.packing
                self._changes.add(lambda name=name, before=before: self._set_packing(name, before))
                pairs = zip(page.targets, page.uvs, strict=True)
                digests = {target.mesh.name: digest_of(uvs) for target, uvs in pairs}
                entry.packing = self._packing(page.targets, digests)

    def _entry(self, atlas: str | None) -> bpy.types.PropertyGroup | None:
        return self._context.scene.hemibake.lightmaps.get(atlas) if atlas is not None else None

    def _set_packing(self, name: str, packing: str) -> None:
        entry = self._entry(name)
        if entry is not None:
            entry.packing = packing

    def _packing(self, targets: Sequence[Target], digests: dict[str, str]) -> str:
        """Return a text that tells how charts are packed, for which surfaces, and to which sizes."""
        properties = self._context.scene.hemibake
        parts = [str(self._resolution), str(properties.padding), str(properties.mip_level)]
        parts.append(str(properties.align_charts))
        surface = max(sum(target.area for target in targets), 1e-300)
        for target in sorted(targets, key=lambda target: target.mesh.name):
            name = target.mesh.name
            parts += [name, f"{target.area / surface:.5f}", digests[name]]
        return hashlib.sha256("|".join(parts).encode()).hexdigest()

    def _finish(self, pages: Sequence[_Page]) -> None:
        """Say who has got UVs, and who has none."""
        targets = [target for page in pages for target in page.targets]
        uids = list(dict.fromkeys(uid for target in targets for uid in target.uids))
        self._made.objects = [self._objects[uid] for uid in uids if uid not in self._moving]
        self._made.moved = [self._objects[uid] for uid in uids if uid in self._moving]
        self._made.skipped = [self._objects[uid] for uid in self._left]
        if targets and not has_xatlas():
            self._made.notes.append(WITHOUT_XATLAS)
        if self._failed:
            self._made.notes.append(naming(XATLAS_FAILED, sorted(self._failed)))
        kept = sorted(self._objects[uid].name for target in targets if target.topology for uid in target.uids)
        if kept:
            sentence = (
                f"Modifiers of {{}} copy or make faces: a last modifier '{NAME}' keeps lightmap UVs of these."
            )
            self._made.notes.append(naming(sentence, kept))
        self._made.notes += self._troubles.tell()


@dataclass(frozen=True)
class _Page:
    """Targets whose charts lie side by side, the UVs of each, and the atlas; None for no atlas yet."""

    targets: list[Target]
    uvs: list[np.ndarray]
    atlas: str | None

    @property
    def uids(self) -> list[int]:
        """The session uids of the objects."""
        return [uid for target in self.targets for uid in target.uids]


def _outdated(obj: bpy.types.Object, modifier: bpy.types.Modifier, depsgraph: bpy.types.Depsgraph) -> bool:
    """Return whether what an object's modifiers make has changed since its UVs were made."""
    with evaluated_mesh(obj, depsgraph) as mesh:
        return mesh is not None and not fits(modifier, mesh)


def _by_atlas(targets: Sequence[Target]) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for index, target in enumerate(targets):
        groups.setdefault(target.atlas, []).append(index)
    return groups


def _without(targets: Sequence[Target], replaced: Sequence[Target]) -> list[Target]:
    """Return the targets that have an object which no other target has replaced."""
    gone = {uid for target in replaced for uid in target.uids}
    return [target for target in targets if any(uid not in gone for uid in target.uids)]


def _tile_width(area: float, total: float, resolution: int) -> int:
    """Return about how many texels wide the tile of a mesh will be."""
    scale = np.sqrt(area / total) if total > 0 else 1.0
    return int(np.clip(resolution * scale, min(64, resolution), resolution))


def spread(properties: bpy.types.PropertyGroup) -> tuple[int, float]:
    """Return over how many lightmaps new UVs are spread, and the texels per metre wanted, 0 for any."""
    if properties.size_mode == "DENSITY":
        return 1, properties.texels_per_metre
    return properties.lightmap_count, 0.0


def _remember_made(obj: bpy.types.Object, digest: str, changes: Changes) -> None:
    """Keep with an object what UVs have been made for it."""
    changes.add(lambda uid=obj.session_uid, before=obj.hemibake.made_uvs: _set_made(uid, before))
    obj.hemibake.made_uvs = digest


def _set_made(uid: int, digest: str) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        obj.hemibake.made_uvs = digest


def _set_atlas(uid: int, atlas: str) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        obj.hemibake.atlas = atlas
