"""The scene and view layer of a piece of work that lasts over many events."""

from __future__ import annotations

import bpy

from ...engine.errors import SceneError
from ..lookup import find


class SceneContext:
    """What such work needs of a context, looked up anew each time it is asked for.

    Between two events an undo may free every datablock, and a window may change to another scene. Raises
    SceneError once the scene or its view layer is gone.

    scene_uid  session uid of the scene
    """

    def __init__(self, context: bpy.types.Context) -> None:
        self.scene_uid, self._view_layer = context.scene.session_uid, context.view_layer.name

    @property
    def scene(self) -> bpy.types.Scene:
        """The scene."""
        scene = find(bpy.data.scenes, self.scene_uid)
        if scene is None:
            raise SceneError("The scene that was being baked is gone. Bake again.")
        return scene

    @property
    def view_layer(self) -> bpy.types.ViewLayer:
        """The view layer."""
        layer = self.scene.view_layers.get(self._view_layer)
        if layer is None:
            raise SceneError(f"The view layer '{self._view_layer}' is gone. Bake again.")
        return layer

    @property
    def world(self) -> bpy.types.World | None:
        """The world of renders: the view layer's override, if it has one."""
        return self.view_layer.world_override or self.scene.world

    @property
    def material_override(self) -> bpy.types.Material | None:
        """The material that renders give to all surfaces of the view layer, if there is one."""
        return self.view_layer.material_override

    def evaluated_depsgraph_get(self) -> bpy.types.Depsgraph:
        """Return the evaluated depsgraph, up to date."""
        layer = self.view_layer
        layer.update()
        return layer.depsgraph
