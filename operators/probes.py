"""Add Light Probes operator: creates a Light Probe Volume around the objects that renders show."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..engine.scene.probe_volume import MAX_PROBES, MAX_RESOLUTION
from .scene import SceneContext, visible_meshes
from .scene.units import metres_per_unit

#: Smallest width of a created volume relative to its largest, so that a flat scene gets a usable one.
_FLAT = 1e-3


class HEMIBAKE_OT_add_light_probes(bpy.types.Operator):
    """Add a Light Probe Volume around all objects that renders show, and switch Light Probes on"""

    bl_idname = "hemibake.add_light_probes"
    bl_label = "Add Light Probes"
    bl_options = {"REGISTER", "UNDO"}

    spacing: bpy.props.FloatProperty(
        name="Spacing",
        description="Set the largest distance between neighboring probes",
        default=1.0,
        min=0.001,
        soft_min=0.1,
        unit="LENGTH",
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave Edit Mode to add light probes")
        return context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        box = _box_of(visible_meshes(SceneContext(context)))
        if box is None:
            self.report({"ERROR"}, "The scene has no visible mesh. Add a mesh first")
            return {"CANCELLED"}
        widths = np.maximum(box[1] - box[0], _FLAT * max((box[1] - box[0]).max(), _FLAT))
        resolution = [max(1, math.ceil(width / self.spacing - 1e-6)) for width in widths]
        count = math.prod(resolution)
        if max(resolution) > MAX_RESOLUTION or count > MAX_PROBES:
            size = " x ".join(map(str, resolution))
            self.report({"ERROR"}, f"Spacing {self.spacing:g} makes {size} probes. Raise Spacing")
            return {"CANCELLED"}
        if context.scene.library is not None:
            self.report({"ERROR"}, f"Scene '{context.scene.name}' is linked. Add light probes in its .blend")
            return {"CANCELLED"}
        _add_volume(context, box.mean(axis=0), widths, resolution)
        context.scene.hemibake.light_probes = True
        self.report({"INFO"}, f"{count:,} light probes. Bake to light them")
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self.spacing = _fitting_spacing(context, 1.0 / metres_per_unit(context.scene))
        return self.execute(context)


def _fitting_spacing(context: bpy.types.Context, spacing: float) -> float:
    """Return a spacing, doubled until a volume around the scene has few enough probes on each axis."""
    box = _box_of(visible_meshes(SceneContext(context)))
    if box is None:
        return spacing
    probes = (box[1] - box[0]) / spacing
    least = max(1.0, probes.max() / MAX_RESOLUTION, float(np.cbrt(np.maximum(probes, 1).prod() / MAX_PROBES)))
    return spacing * 2.0 ** math.ceil(math.log2(least))


def _box_of(objects: list[bpy.types.Object]) -> np.ndarray | None:
    """Return the corners of the box around objects, (2, 3) float64, world space; None without objects."""
    corners = [obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box]
    return np.array([np.min(corners, axis=0), np.max(corners, axis=0)]) if corners else None


def _add_volume(
    context: bpy.types.Context, centre: np.ndarray, widths: np.ndarray, resolution: list[int]
) -> None:
    """Add a Light Probe Volume object to the active collection; the selection stays.

    A linked or overridden collection takes no objects, so the scene's own gets it instead.
    """
    data = bpy.data.lightprobes.new("Volume", "VOLUME")
    data.resolution_x, data.resolution_y, data.resolution_z = resolution
    obj = bpy.data.objects.new("Volume", data)
    obj.matrix_world = Matrix.LocRotScale(Vector(centre), None, Vector(widths / 2))
    active = context.collection
    is_own = active.library is None and active.override_library is None
    (active if is_own else context.scene.collection).objects.link(obj)


CLASSES = (HEMIBAKE_OT_add_light_probes,)
