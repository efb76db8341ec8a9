"""Accesses the dependency graph of renders, which Blender passes to the `bake` callback of render engines."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import bpy

from ....engine.errors import SceneError

Made = TypeVar("Made")

#: Name of the triangle that Blender bakes, because there is no callback without an object to bake.
_NAME = ".Hemibake reader"

#: Types of objects whose edit-mode changes must be written to their data before a render can read them.
_EDITED = {"MESH", "CURVE", "SURFACE", "FONT", "META"}


class _Reader(bpy.types.RenderEngine):
    """Render engine that calls a function with its dependency graph.

    It is registered only while it is used, so that the list of render engines does not show it.

    active:  True while the dependency graph exists; scene updates in this time come from Hemibake
    job:     the function
    """

    bl_idname = "HEMIBAKE_READ"
    bl_label = "Hemibake Reader"

    active = False
    job: Callable[[bpy.types.Depsgraph], None] | None = None

    def bake(
        self,
        depsgraph: bpy.types.Depsgraph,
        obj: bpy.types.Object,
        pass_type: str,
        pass_filter: int,
        width: int,
        height: int,
    ) -> None:
        """Call the function; Blender requires exactly these arguments."""
        assert _Reader.job is not None
        _Reader.job(depsgraph)


def reads_render() -> bool:
    """Return True while a dependency graph of renders is read, so that scene updates come from Hemibake."""
    return _Reader.active


def in_render(
    job: Callable[[bpy.types.Depsgraph], Made], scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> Made:
    """Call a function with the dependency graph of a render, and return its result.

    The graph is freed afterwards, so that the function must copy the data it needs. It must not call Cycles.
    Blender evaluates the whole view layer at once, without slices. Errors of the function are raised again.
    Raises SceneError if Blender does not make the graph.
    """
    results: list[Made] = []
    errors: list[BaseException] = []

    def call(depsgraph: bpy.types.Depsgraph) -> None:
        # Catch exceptions of the callback, because Blender only prints them.
        try:
            results.append(job(depsgraph))
        except BaseException as error:  # noqa: BLE001
            errors.append(error)

    _update(view_layer)
    _Reader.active, _Reader.job = True, call
    try:
        _store_edits(view_layer)
        with _registered(), _triangle(scene) as triangle, _engine(scene):
            view_layer.update()
            _bake(scene, view_layer, triangle)
    except RuntimeError as error:
        if not errors:
            reason = str(error).strip().splitlines()[-1]
            raise SceneError(
                f"Scene '{scene.name}': Blender cannot evaluate it as a render does ({reason}). "
                "End other renders and bake again."
            ) from error
    finally:
        _Reader.job = None
        _update(view_layer)
        _Reader.active = False
    if errors:
        raise errors[0]
    if not results:
        raise SceneError(f"Scene '{scene.name}': Blender has not evaluated it as a render does. Bake again.")
    return results[0]


def _update(view_layer: bpy.types.ViewLayer) -> None:
    """Send pending depsgraph updates of a view layer, and of all view layers in windows, to handlers."""
    view_layer.update()
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            window.view_layer.update()


def _store_edits(view_layer: bpy.types.ViewLayer) -> None:
    """Write edit-mode changes to objects' data, which is all that a render reads."""
    for obj in view_layer.objects:
        if obj.mode == "EDIT" and obj.type in _EDITED:
            obj.update_from_editmode()


@contextmanager
def _registered() -> Iterator[None]:
    """Register the render engine inside the `with` block."""
    bpy.utils.register_class(_Reader)
    try:
        yield
    finally:
        bpy.utils.unregister_class(_Reader)


@contextmanager
def _engine(scene: bpy.types.Scene) -> Iterator[None]:
    """Set the render engine of a scene inside the `with` block."""
    before = scene.render.engine
    scene.render.engine = _Reader.bl_idname
    try:
        yield
    finally:
        scene.render.engine = before


@contextmanager
def _triangle(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Link a triangle, on which Blender can bake vertex colors, inside the `with` block."""
    mesh = bpy.data.meshes.new(_NAME)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    mesh.color_attributes.new("Color", "FLOAT_COLOR", "CORNER")
    obj = bpy.data.objects.new(_NAME, mesh)
    try:
        scene.collection.objects.link(obj)
        yield obj
    finally:
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)


def _bake(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, obj: bpy.types.Object) -> None:
    """Bake an object with the engine; selection and active object do not change."""
    context: dict[str, Any] = {"scene": scene, "view_layer": view_layer, "active_object": obj, "object": obj}
    context |= {"selected_objects": [obj], "selected_editable_objects": [obj]}
    with bpy.context.temp_override(**context):
        bpy.ops.object.bake(
            type="COMBINED",
            target="VERTEX_COLORS",
            use_clear=False,
            save_mode="INTERNAL",
            use_selected_to_active=False,
        )
