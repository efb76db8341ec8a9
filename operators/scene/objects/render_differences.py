"""Detects differences between the viewport and renders of a scene.

The tests read only settings and are therefore fast. They may report a difference although the results are
equal, but they do not miss one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy

from ..scene_context import SceneContext
from .render_settings import level_settings
from .visible import visible_objects

#: Resolution properties for the viewport and for renders, by type of object. A value of 0 for renders means
#: the viewport's value.
_RESOLUTIONS = {
    "CURVE": (("resolution_u", "render_resolution_u"), ("resolution_v", "render_resolution_v")),
    "FONT": (("resolution_u", "render_resolution_u"),),
    "SURFACE": (("resolution_u", "render_resolution_u"), ("resolution_v", "render_resolution_v")),
    "META": (("resolution", "render_resolution"),),
}

#: Custom property of the node groups that store lightmap UVs, which give both meshes the same light.
UV_GROUP = "hemibake_uv_layer"

#: Custom property of the objects whose vertices hold lightmap UVs for these node groups.
UV_CARRIER = "hemibake_uvs"

#: Modifiers whose result depends only on their own object.
_INDEPENDENT = {
    "BEVEL", "BUILD", "DECIMATE", "EDGE_SPLIT", "MULTIRES", "REMESH", "SKIN", "SMOOTH", "SOLIDIFY", "SUBSURF",
    "TRIANGULATE", "WEIGHTED_NORMAL", "WELD", "WIREFRAME",
}  # fmt: skip

#: Modes in which the viewport does not apply all modifiers.
_EDITED = {"EDIT", "SCULPT"}


def uses_render(context: SceneContext) -> bool:
    """Return True if a bake must evaluate the dependency graph of renders.

    It must if renders show other objects than the viewport, or if *Meshes* is *Render* and meshes differ.
    """
    if hidden_in_viewport(context):
        return True
    if context.scene.hemibake.meshes == "VIEWPORT":
        return False
    return _instances_differ() or any(Geometry(context.scene).differing(bpy.data.objects))


def reads_viewport(context: SceneContext, objects: Iterable[bpy.types.Object]) -> bool:
    """Return True if the viewport's meshes of these objects equal the meshes to bake."""
    layer, geometry = context.view_layer, Geometry(context.scene)
    return all(
        obj.visible_get(view_layer=layer) and not _may_depend(obj) and not geometry.differs(obj)
        for obj in objects
    )


def _may_depend(obj: bpy.types.Object) -> bool:
    """Return True if the mesh of an object may depend on other objects."""
    return any(modifier.type not in _INDEPENDENT and not _keeps_uvs(modifier) for modifier in obj.modifiers)


def _keeps_uvs(modifier: bpy.types.Modifier) -> bool:
    """Return True if a modifier only stores lightmap UVs."""
    group = getattr(modifier, "node_group", None)
    return group is not None and UV_GROUP in group


def hidden_in_viewport(context: SceneContext) -> list[bpy.types.Object]:
    """Return the objects that renders show and the viewport hides."""
    layer = context.view_layer
    return [obj for obj in visible_objects(context) if not obj.visible_get(view_layer=layer)]


class Geometry:
    """Tests whether objects have other geometry in renders than in the viewport, with a scene's settings."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        self._render = scene.render
        self._known: dict[int, bool] = {}

    def differing(self, objects: Iterable[bpy.types.Object]) -> Iterator[bpy.types.Object]:
        """Yield the objects whose own settings differ; other objects may depend on these."""
        return (obj for obj in objects if self.differs(obj))

    def differs(self, obj: bpy.types.Object) -> bool:
        """Return True if the settings of an object differ."""
        if obj.type in _RESOLUTIONS and _resolution_differs(obj):
            return True
        return any(self._modifier_differs(modifier) for modifier in obj.modifiers)

    def _modifier_differs(self, modifier: bpy.types.Modifier) -> bool:
        if modifier.show_viewport != modifier.show_render:
            return True
        if not modifier.show_render:
            return False
        if modifier.id_data.mode in _EDITED and not (
            modifier.show_in_editmode and modifier.type != "MULTIRES"
        ):
            return True
        names = level_settings(modifier)
        if names is not None:
            shown, rendered = (getattr(modifier, name) for name in names)
            if modifier.type in ("SUBSURF", "MULTIRES") and self._render.use_simplify:
                shown = min(shown, self._render.simplify_subdivision)
                rendered = min(rendered, self._render.simplify_subdivision_render)
            return shown != rendered
        if modifier.type == "PARTICLE_SYSTEM":
            return self._particles_differ(modifier.particle_system.settings)
        return modifier.type == "NODES" and self._has_viewport_test(modifier.node_group)

    def _particles_differ(self, settings: bpy.types.ParticleSettings) -> bool:
        """Return True if renders have more or other particles, or hair with finer steps."""
        if settings.display_percentage != 100:
            return True
        strands = settings.type == "HAIR" or settings.render_type == "PATH"
        if strands and settings.display_step != settings.render_step:
            return True
        if settings.display_method != "RENDER" or settings.child_type != "NONE":
            return True
        return self._render.use_simplify

    def _has_viewport_test(self, group: bpy.types.NodeTree | None) -> bool:
        """Return True if a node group, or a group inside it, contains an Is Viewport node."""
        if group is None or UV_GROUP in group:
            return False
        key = group.session_uid
        if key not in self._known:
            self._known[key] = False
            self._known[key] = any(
                node.bl_idname == "GeometryNodeIsViewport"
                or self._has_viewport_test(getattr(node, "node_tree", None))
                for node in group.nodes
            )
        return self._known[key]


def _resolution_differs(obj: bpy.types.Object) -> bool:
    pairs = ((getattr(obj.data, name, 0) for name in names) for names in _RESOLUTIONS[obj.type])
    return any(rendered not in (0, shown) for shown, rendered in pairs)


def _instances_differ() -> bool:
    """Return True if instances may differ: objects in instanced collections have their own settings."""
    instancers = [obj for obj in bpy.data.objects if is_instancer(obj)]
    if not instancers:
        return False
    if any(obj.hide_render or _shows_itself_otherwise(obj) for obj in instancers):
        return True
    if _scatter_hidden(instancers):
        return True
    return any(obj.hide_viewport and not obj.hide_render for obj in bpy.data.objects) or any(
        collection.hide_viewport != collection.hide_render for collection in bpy.data.collections
    )


def _scatter_hidden(instancers: Iterable[bpy.types.Object]) -> bool:
    """Return True if only renders tell which instances of objects that are hidden in renders they show.

    Geometry Nodes and particles show such an object if they name it, but not if they take its collection as a
    whole. Instances inside an instanced collection do not tell which object makes them.
    """
    makers = {obj for obj in instancers if scatters(obj)}
    hidden = {obj for obj in bpy.data.objects if obj.hide_render and UV_CARRIER not in obj}
    if not makers or not hidden:
        return False
    collections = {group for group in bpy.data.collections if not hidden.isdisjoint(group.all_objects)}
    nested = any(obj.instance_type == "COLLECTION" for obj in instancers)
    asked = collections | hidden if nested else collections
    users = bpy.data.user_map(subset=list(asked), value_types={"NODETREE", "PARTICLE", "OBJECT"})
    return any(
        user in makers or not isinstance(user, bpy.types.Object) for found in users.values() for user in found
    )


def is_instancer(obj: bpy.types.Object) -> bool:
    """Return True if an object may make instances."""
    return obj.instance_type != "NONE" or scatters(obj)


def scatters(obj: bpy.types.Object) -> bool:
    """Return True if an object may make instances by Geometry Nodes or particles."""
    return any(
        modifier.type in ("NODES", "PARTICLE_SYSTEM") and not _keeps_uvs(modifier)
        for modifier in obj.modifiers
    )


def _shows_itself_otherwise(obj: bpy.types.Object) -> bool:
    return obj.show_instancer_for_render != obj.show_instancer_for_viewport
