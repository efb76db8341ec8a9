"""What happens when a file is saved or appended, or another one is opened.

Lightmap UVs that nothing needs are removed; what bakes of the old file have left is freed.
"""

from __future__ import annotations

from bpy.app.handlers import persistent

from .compat import FILE_EVENTS
from .handlers import Handlers
from .scene.light.kept_worlds import kept_worlds
from .scene.materials.kept_evaluations import kept_evaluations
from .scene.uvs.uv_node_group import remove_unused_uvs
from .worker_owner import owner


@persistent
def _tidy(*_: object) -> None:
    """Remove what nothing needs; a bake that runs may still take back that it is unused."""
    if not owner.busy:
        remove_unused_uvs()


@persistent
def _forget(*_: object) -> None:
    """Free what is kept of bakes of the file before."""
    owner.forget()
    kept_evaluations.clear()
    kept_worlds.clear()


_handlers = Handlers({"load_post": _forget, **dict.fromkeys(FILE_EVENTS, _tidy)})

#: Have Blender call it from now on; have it called no more.
bind, unbind = _handlers.begin, _handlers.end
