"""Handlers of file events: saving, appending and loading.

Saving and appending remove unused lightmap UVs. Loading frees the cached data of the old file.
"""

from __future__ import annotations

from bpy.app.handlers import persistent

from .compat import FILE_EVENTS
from .handlers import Handlers
from .scene.light.kept_worlds import kept_worlds
from .scene.materials.evaluation_cache import kept_evaluations
from .scene.objects.instancing import forget_instances
from .scene.uvs.uv_node_group import remove_unused_uvs
from .worker_manager import owner


@persistent
def _tidy(*_: object) -> None:
    """Remove lightmap UVs that no object uses. Does nothing during a bake, which may have to restore them."""
    if not owner.busy:
        remove_unused_uvs()


@persistent
def _forget(*_: object) -> None:
    """Free cached data of bakes when another file is loaded."""
    owner.forget()
    kept_evaluations.clear()
    kept_worlds.clear()


_forget_instances = persistent(forget_instances)

_CHANGES = ("depsgraph_update_post", "frame_change_post", "undo_post", "redo_post", "load_post")

_file_handlers = Handlers({"load_post": _forget, **dict.fromkeys(FILE_EVENTS, _tidy)})
_change_handlers = Handlers(dict.fromkeys(_CHANGES, _forget_instances))


def bind() -> None:
    """Register the handlers."""
    _file_handlers.begin()
    _change_handlers.begin()


def unbind() -> None:
    """Unregister the handlers."""
    _change_handlers.end()
    _file_handlers.end()
