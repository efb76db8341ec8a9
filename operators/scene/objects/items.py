"""Iterates over the objects and instances that a render shows, with their matrices."""

from __future__ import annotations

from collections.abc import Iterator, Set
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import bpy
import numpy as np

from .render_differences import scatters

#: Key of an object or instance: session uids of the source object and of the instancer, if any, and Blender's
#: persistent id of the instance.
ItemKey = tuple[int, int | None, tuple[int, ...]]

#: Types of instancers that show their children.
_OF_CHILDREN = ("VERTS", "FACES")

#: Types of objects that Blender evaluates to a mesh.
_CURVES = ("CURVE", "SURFACE", "FONT")


@dataclass(frozen=True)
class SceneItem:
    """An object or instance; valid until the iteration over `scene_items` continues.

    index:          index among all objects and instances of the dependency graph
    object:         the evaluated object
    source:         the original object
    matrix:         (4, 4) float64, object space to world space
    instancer:      the original object that makes the instance; None for an object itself
    persistent_id:  Blender's identifier of the instance
    random:         Cycles' random number of it, in [0, 1]
    shows_self:     False if only its hair is visible
    """

    index: int
    object: bpy.types.Object
    source: bpy.types.Object
    matrix: np.ndarray
    instancer: bpy.types.Object | None
    persistent_id: tuple[int, ...]
    random: float
    shows_self: bool

    @property
    def key(self) -> ItemKey:
        """Key of the object or instance."""
        instancer = None if self.instancer is None else self.instancer.session_uid
        return self.source.session_uid, instancer, self.persistent_id


class Hidden(NamedTuple):
    """Kinds of rays that ignore an object.

    from_shadow:   True if shadow rays to lights pass it
    from_bounces:  True if rays of gathered light pass it
    """

    from_shadow: bool
    from_bounces: bool


def hidden_from(item: SceneItem) -> Hidden:
    """Return the kinds of rays that ignore an object or instance, by Cycles' ray visibility.

    An instance is hidden if its source object or its instancer is hidden (Cycles, blender/object.cpp). The
    flags for camera, glossy, transmission and volume rays do not affect diffuse light.
    """
    owners = [item.source] if item.instancer is None else [item.source, item.instancer]
    return Hidden(
        from_shadow=not all(owner.visible_shadow for owner in owners),
        from_bounces=not all(owner.visible_diffuse for owner in owners),
    )


def scene_items(
    depsgraph: bpy.types.Depsgraph, visible: Set[int], start: int = 0, with_hair: bool = False
) -> Iterator[SceneItem]:
    """Yield the objects and instances of a dependency graph that renders show.

    visible:    session uids of the objects that renders show
    start:      index of the first one
    with_hair:  True to include objects with visible hair and an invisible surface, see `SceneItem.shows_self`
    """
    for index, instance in enumerate(islice(depsgraph.object_instances, start, None), start):
        parent = instance.parent.original if instance.is_instance else None
        source = instance.object.original
        shown = parent if parent is not None else source
        shows_self = parent is not None or instance.show_self
        if shown.session_uid not in visible or not (shows_self or with_hair):
            continue
        if not is_rendered(source, parent, depsgraph.mode):
            continue
        number = tuple(instance.persistent_id) if parent is not None else ()
        matrix = np.array(instance.matrix_world, np.float64)
        bits = name_hash(source.name) if parent is None else instance.random_id & 0xFFFFFFFF
        yield SceneItem(
            index=index,
            object=instance.object,
            source=source,
            matrix=matrix,
            instancer=parent,
            persistent_id=number,
            random=bits / 0xFFFFFFFF,
            shows_self=shows_self,
        )


def is_rendered(source: bpy.types.Object, instancer: bpy.types.Object | None, mode: str) -> bool:
    """Return True if renders show an object or instance of a dependency graph.

    The graph of renders contains only what they show. In that of the viewport, instances of an object that
    itself is hidden in renders count if Geometry Nodes or particles make them, and not if vertices or faces
    of the object's parent do. Renders then do not evaluate the faces of curves, surfaces and texts.

    source:     the original object
    instancer:  the original object that makes the instance; None for an object itself
    mode:       mode of the dependency graph, VIEWPORT or RENDER
    """
    if mode == "RENDER" or not source.hide_render:
        return True
    if instancer is None or source.type in _CURVES:
        return False
    if instancer.instance_type in _OF_CHILDREN and _descends(source, instancer):
        return False
    return scatters(instancer)


def _descends(obj: bpy.types.Object, ancestor: bpy.types.Object) -> bool:
    """Return True if an object is a child of another, or a child of its children."""
    parent = obj.parent
    return parent is not None and (parent == ancestor or _descends(parent, ancestor))


def name_hash(name: str) -> int:
    """Return Cycles' 32-bit hash of an object's name: a polynomial in 37, mixed with 0.

    Mixing: Jenkins 2006, lookup3, final mix of two words (Cycles, util/hash.h).
    """
    word = 0
    for byte in name.encode():
        word = (word * 37 + byte) & 0xFFFFFFFF
    state = [(0xDEADBEEF + 8 + 13) & 0xFFFFFFFF] * 3
    state[0] = (state[0] + word) & 0xFFFFFFFF
    for step, turn in enumerate((14, 11, 25, 16, 4, 14, 24)):
        into, of = (step + 2) % 3, (step + 1) % 3
        turned = (state[of] << turn | state[of] >> (32 - turn)) & 0xFFFFFFFF
        state[into] = ((state[into] ^ state[of]) - turned) & 0xFFFFFFFF
    return state[2]
