"""The scene and view layer of work that takes longer than one event."""

from __future__ import annotations

import bpy

from ...engine.errors import SceneError
from ..lookup import find


class SceneContext:
    """Scene and view layer, looked up again for each access.

    Between two events an undo may free all datablocks, and a window may switch to another scene. Raises
    SceneError if the scene or its view layer was deleted.

    scene_uid:  session uid of the scene
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
        """The world of renders: the view layer's override, else the scene's; None if the layer has none."""
        if not self.view_layer.use_sky:
            return None
        return self.view_layer.world_override or self.scene.world

    @property
    def material_override(self) -> bpy.types.Material | None:
        """The view layer's material override; None without one."""
        return self.view_layer.material_override

    def evaluated_depsgraph_get(self) -> bpy.types.Depsgraph:
        """Return the updated dependency graph."""
        layer = self.view_layer
        layer.update()
        return layer.depsgraph
