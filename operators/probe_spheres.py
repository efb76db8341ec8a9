"""Show Light Probes operator: displays the probes of the last bake as spheres that have their light."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ..engine.scene.probe_volume import ProbeVolume
from .result.preview import hide_preview, renew_preview, show_preview, shows_preview
from .viewports import show_materials

#: Custom property that marks the object of the spheres.
_MARK = "hemibake_probe_spheres"

#: Radius of a sphere, as a fraction of the smallest distance between probes (chosen).
_RADIUS = 0.15

#: Maximum number of spheres: 1.2 million vertices (chosen).
_MAX_SPHERES = 1 << 16


class HEMIBAKE_OT_show_light_probes(bpy.types.Operator):
    """Show the light probes of the last bake as spheres with their light, or remove the spheres again"""

    bl_idname = "hemibake.show_light_probes"
    bl_label = "Show Light Probes"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        scene = context.scene
        is_ready = context.mode == "OBJECT" and (
            any(entry.image for entry in scene.hemibake.probe_volumes) or bool(_spheres(scene))
        )
        if not is_ready:
            cls.poll_message_set("Bake with Light Probes, and leave Edit Mode, to show probes")
        return is_ready

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        shown = _spheres(scene)
        if shown:
            _remove(shown)
            return {"FINISHED"}
        volumes = [
            ProbeVolume(entry.name, np.array(entry.matrix, np.float64).reshape(4, 4), tuple(entry.resolution))
            for entry in scene.hemibake.probe_volumes
        ]
        count = sum(volume.count for volume in volumes)
        if count > _MAX_SPHERES:
            self.report(
                {"ERROR"},
                f"{count:,} probes exceed {_MAX_SPHERES:,} spheres. Lower their resolution, and bake",
            )
            return {"CANCELLED"}
        _add(scene, volumes)
        depsgraph = context.evaluated_depsgraph_get()
        if shows_preview(scene):
            renew_preview(scene, depsgraph)
        else:
            show_preview(scene, depsgraph)
        show_materials(context)
        self.report({"INFO"}, f"{count:,} light probes are shown")
        return {"FINISHED"}


def _spheres(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects of spheres in a scene; a user may have copied the first one."""
    return [obj for obj in scene.objects if obj.get(_MARK)]


def _add(scene: bpy.types.Scene, volumes: Sequence[ProbeVolume]) -> None:
    """Add an object with a sphere at each probe, which the preview lights as a dynamic object.

    Renders, bakes and the mouse ignore it.
    """
    vertices, triangles = _sphere()
    positions = [
        (volume.points()[:, None] + _RADIUS * volume.spacing * vertices).reshape(-1, 3) for volume in volumes
    ]
    points = np.concatenate(positions).astype(np.float32)
    first = len(vertices) * np.arange(len(points) // len(vertices))
    corners = (first[:, None, None] + triangles).reshape(-1, 3).astype(np.int32)
    mesh = bpy.data.meshes.new("Light Probe Spheres")
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.ravel())
    mesh.loops.add(corners.size)
    mesh.loops.foreach_set("vertex_index", corners.ravel())
    mesh.polygons.add(len(corners))
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners.size, 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    white = bpy.data.materials.new("Light Probe Spheres")
    if white.node_tree is None:
        white.use_nodes = True
    white.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    mesh.materials.append(white)
    obj = bpy.data.objects.new("Light Probe Spheres", mesh)
    obj[_MARK] = True
    obj.hide_render = obj.hide_select = True
    obj.hemibake.role = "DYNAMIC"
    scene.collection.objects.link(obj)


def _sphere() -> tuple[np.ndarray, np.ndarray]:
    """Return an octahedron whose faces are split once: unit vertices, (18, 3), and triangles, (32, 3)."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    faces = np.array(
        [
            (x, y, z) if (x < 3) == ((y < 3) == (z < 3)) else (x, z, y)
            for x in (0, 3)
            for y in (1, 4)
            for z in (2, 5)
        ]
    )
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges = np.unique(np.sort(sides, axis=1), axis=0).tolist()
    number = {tuple(edge): 6 + index for index, edge in enumerate(edges)}
    middles = np.array([corners[one] + corners[other] for one, other in edges]) / np.sqrt(2)
    triangles = []
    for a, b, c in faces.tolist():
        ab, bc, ca = (number[min(pair), max(pair)] for pair in ((a, b), (b, c), (c, a)))
        triangles += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([corners, middles]), np.array(triangles)


def _remove(objects: Sequence[bpy.types.Object]) -> None:
    """Remove the spheres with their meshes and materials; linked duplicates share them."""
    hide_preview(objects)
    meshes = {obj.data for obj in objects}
    materials = {material for mesh in meshes for material in mesh.materials if material is not None}
    for obj in objects:
        bpy.data.objects.remove(obj)
    for mesh in meshes:
        if not mesh.users:
            bpy.data.meshes.remove(mesh)
    for material in materials:
        if not material.users:
            bpy.data.materials.remove(material)


CLASSES = (HEMIBAKE_OT_show_light_probes,)
