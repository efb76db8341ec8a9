"""Hemibake, a Blender extension that bakes lightmaps with texture-space radiosity."""


def register() -> None:
    """Add Hemibake's operators, properties and panels to Blender."""
    from . import operators, panels

    operators.register()
    panels.register()


def unregister() -> None:
    """Take everything that `register` added away again, and end the worker."""
    from . import operators, panels

    panels.unregister()
    operators.unregister()
