"""Search for datablocks by session uid, since undo and file loads invalidate references."""

from __future__ import annotations

from collections.abc import Iterable

import bpy


def find(collection: Iterable[bpy.types.ID], uid: int) -> bpy.types.ID | None:
    """Return the datablock with a session uid, or None if it no longer exists.

    Undo frees and recreates datablocks but keeps their uids. Datablocks of another file have other uids.
    """
    return next((item for item in collection if item.session_uid == uid), None)


def find_all(collection: Iterable[bpy.types.ID], uids: Iterable[int]) -> list[bpy.types.ID]:
    """Return the datablocks with these session uids, in this order, without deleted ones."""
    present = {item.session_uid: item for item in collection}
    return [present[uid] for uid in uids if uid in present]
