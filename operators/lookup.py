"""Find datablocks again after an undo, a deletion or another file."""

from __future__ import annotations

from collections.abc import Iterable

import bpy


def find(collection: Iterable[bpy.types.ID], uid: int) -> bpy.types.ID | None:
    """Return the datablock with a session uid, or None if it is gone.

    Undo frees and remakes datablocks but keeps the uid; another file never has the same one.
    """
    return next((item for item in collection if item.session_uid == uid), None)


def find_all(collection: Iterable[bpy.types.ID], uids: Iterable[int]) -> list[bpy.types.ID]:
    """Return the datablocks with these session uids that are still there, in the order of the uids."""
    present = {item.session_uid: item for item in collection}
    return [present[uid] for uid in uids if uid in present]
