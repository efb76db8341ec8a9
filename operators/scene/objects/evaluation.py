"""Evaluated objects of a bake: of the render's dependency graph, or of the viewport's if both are equal."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Set
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import bpy

from ..scene_context import SceneContext
from .items import SceneItem, scene_items
from .render_depsgraph import in_render
from .render_differences import hidden_in_viewport, reads_viewport, uses_render

Made = TypeVar("Made")


@dataclass(frozen=True)
class Evaluation:
    """Evaluated objects and instances, valid only inside the function that receives them.

    depsgraph:  dependency graph of objects that only renders show, and of all objects if `viewport` is None
    viewport:   dependency graph of the other objects
    hidden:     session uids of the objects that only renders show
    """

    depsgraph: bpy.types.Depsgraph
    viewport: bpy.types.Depsgraph | None = None
    hidden: Set[int] = frozenset()

    @property
    def depsgraphs(self) -> tuple[bpy.types.Depsgraph, ...]:
        """All dependency graphs."""
        return (self.depsgraph,) if self.viewport is None else (self.viewport, self.depsgraph)

    def evaluated(self, obj: bpy.types.Object) -> bpy.types.Object:
        """Return an object with its modifiers applied; `is_evaluated` is False if it was not evaluated."""
        return obj.evaluated_get(self._of(obj))

    def items(self, visible: Set[int], with_hair: bool = False) -> Iterator[SceneItem]:
        """Yield the objects and instances.

        visible:    session uids of the objects that renders show
        with_hair:  True to include objects with visible hair and an invisible surface
        """
        if self.viewport is None:
            return scene_items(self.depsgraph, visible, with_hair=with_hair)
        return chain(
            scene_items(self.viewport, visible - self.hidden, with_hair=with_hair),
            scene_items(self.depsgraph, self.hidden, with_hair=with_hair),
        )

    def depsgraph_of(self, item: SceneItem) -> bpy.types.Depsgraph:
        """Return the dependency graph of an object or instance."""
        return self._of(item.source if item.instancer is None else item.instancer)

    def _of(self, obj: bpy.types.Object) -> bpy.types.Depsgraph:
        if self.viewport is None or obj.session_uid in self.hidden:
            return self.depsgraph
        return self.viewport


def evaluate(
    context: SceneContext,
    job: Callable[[Evaluation], Made],
    only: Collection[bpy.types.Object] | None = None,
    render: bool = False,
) -> Made:
    """Call a function with the evaluated objects of a bake, and return its result.

    The function must not keep evaluated objects, and must not call Cycles. Raises SceneError if Blender does
    not evaluate the scene as in a render.

    only:    the objects that the function reads, without instances; None for all
    render:  True to evaluate the render's dependency graph, even if both are equal
    """
    if not render and (not uses_render(context) or (only is not None and reads_viewport(context, only))):
        return job(Evaluation(context.evaluated_depsgraph_get()))
    return in_render(lambda depsgraph: job(_chosen(context, depsgraph)), context.scene, context.view_layer)


def _chosen(context: SceneContext, depsgraph: bpy.types.Depsgraph) -> Evaluation:
    """Return the evaluated objects for the setting Meshes: of a render or of the viewport."""
    if context.scene.hemibake.meshes == "RENDER":
        return Evaluation(depsgraph)
    hidden = frozenset(obj.session_uid for obj in hidden_in_viewport(context))
    return Evaluation(depsgraph, context.view_layer.depsgraph, hidden)
