"""The add-on's operators: read the scene, bake it, store the lightmaps, report.

Nothing is imported here, so that the command line can be imported without bpy.
"""


def register() -> None:
    """Register the properties, the operators and the command."""
    import bpy

    from . import command_line, file_handlers, preview_switch, properties, translations

    for cls in _classes():
        bpy.utils.register_class(cls)
    properties.bind()
    translations.bind()
    file_handlers.bind()
    preview_switch.bind()
    command_line.register()


def unregister() -> None:
    """End all bakes, restore materials, and unregister the command, the operators and the properties."""
    import bpy

    from . import command_line, file_handlers, preview_switch, properties, translations, warm_up
    from .devices import finder
    from .preview import restore_materials
    from .worker_manager import owner

    warm_up.unbind()
    finder.stop()
    owner.stop()
    command_line.unregister()
    preview_switch.unbind()
    restore_materials()
    file_handlers.unbind()
    translations.unbind()
    properties.unbind()
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)


def _classes() -> tuple[type, ...]:
    from . import (
        bake,
        checks,
        export,
        last_bake,
        light_states,
        lightmap_size,
        lightmaps,
        live,
        preferences,
        presets,
        preview,
        preview_switch,
        probe_spheres,
        probes,
        properties,
        select,
        self_test,
        unwrap,
        uv_modifiers,
    )

    modules = (
        properties, presets, bake, live, checks, unwrap, uv_modifiers, lightmap_size, lightmaps,
        light_states, preview, preview_switch, export, probes, probe_spheres, select, last_bake, preferences,
        self_test,
    )  # fmt: skip
    return tuple(cls for module in modules for cls in module.CLASSES)
