"""What happens when a file is saved or appended: lightmap UVs that nothing needs are removed."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from .compat import FILE_EVENTS
from .scene.uvs.uv_node_group import remove_unused_uvs
from .worker_owner import owner


@persistent
def _tidy(*_: object) -> None:
    """Remove what nothing needs; a bake that runs may still take back that it is unused."""
    if not owner.busy:
        remove_unused_uvs()


def bind() -> None:
    """Let Blender call it."""
    for name in FILE_EVENTS:
        getattr(bpy.app.handlers, name).append(_tidy)


def unbind() -> None:
    """Let Blender call it no more."""
    for name in FILE_EVENTS:
        handlers = getattr(bpy.app.handlers, name)
        if _tidy in handlers:
            handlers.remove(_tidy)
