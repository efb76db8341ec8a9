"""What a click or a script starts: gather the scene, bake it, store the result, report."""

import bpy

from . import bake, preview, properties, unwrap
from .worker_owner import owner

_CLASSES = (*properties.CLASSES, *bake.CLASSES, *unwrap.CLASSES, *preview.CLASSES)


def register() -> None:
    """Register the properties and the operators."""
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    properties.bind()


def unregister() -> None:
    """Stop all that bakes, then unregister the operators and the properties."""
    owner.stop()
    properties.unbind()
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
