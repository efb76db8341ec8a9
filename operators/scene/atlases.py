"""Which lightmap each object goes to."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import bpy

from ...engine.errors import SceneError

#: Largest number of lightmaps that objects which share meshes may lead to.
_MOST = 64


def assign_atlases(objects: Sequence[bpy.types.Object], notes: list[str]) -> list[str]:
    """Return the atlas name of each object; raises SceneError if shared meshes lead to too many.

    Objects that share a mesh share its UVs and would lie on top of each other: within an atlas
    the first keeps it, each other one gets an atlas of its own, which is said in `notes`.
    """
    used = {obj.hemibake.atlas for obj in objects}
    taken: set[tuple[str, int]] = set()
    names, shared = [], Counter()
    for obj in objects:
        name = obj.hemibake.atlas
        if (name, obj.data.session_uid) in taken:
            name = _fresh(f"{name}.{obj.name}", used)
            shared[obj.data.name] += 1
        taken.add((name, obj.data.session_uid))
        used.add(name)
        names.append(name)
    if shared:
        _tell_shared(shared, len(used), notes)
    return names


def _fresh(name: str, used: set[str]) -> str:
    """Return a name that is not used yet."""
    if name not in used:
        return name
    return next(fresh for number in range(1, 10**6) if (fresh := f"{name}.{number:03d}") not in used)


def _tell_shared(shared: Counter[str], atlases: int, notes: list[str]) -> None:
    """Say that objects which share meshes get lightmaps of their own, or that they are too many."""
    mesh, others = shared.most_common(1)[0]
    remedy = (
        "Make them single-user (Object > Relations > Make Single User > Object & Data), delete the lightmap "
        "UV layer of the copies and unwrap them together."
    )
    if atlases > _MOST:
        raise SceneError(
            f"The scene would have {atlases} lightmaps, more than {_MOST}: objects that share a mesh each "
            f"get one, and {others + 1} share the mesh '{mesh}'. {remedy}"
        )
    notes.append(
        f"{shared.total()} objects share a mesh with another one ('{mesh}' has {others + 1} users): each has "
        f"a lightmap of its own at full resolution. For one lightmap: {remedy}"
    )
