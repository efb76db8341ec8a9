"""Add Light Probes operator: creates a Light Probe Volume that fills the room of a scene."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..engine.errors import EngineError
from ..engine.scene.probe_volume import MAX_PROBES, MAX_RESOLUTION, filling_grid
from .scene import SceneContext
from .scene.room import room_of
from .scene.units import metres_per_unit

#: Smallest width of a created volume relative to its largest, so that a flat scene gets a usable one.
_FLAT = 1e-3

#: Default spacing: steps across the narrowest side of a room, for light on the floor within 5 % of its
#: lightmap (docs/design/probes.md), unless there are more probes than `_MANY`. Sides narrower than `_NARROW`
#: of the longest do not count (chosen).
_STEPS, _MANY, _NARROW = 8.1, 1 << 15, 0.1


class HEMIBAKE_OT_add_light_probes(bpy.types.Operator):
    """Add a Light Probe Volume inside the outer walls of rendered objects, and switch Light Probes on"""

    bl_idname = "hemibake.add_light_probes"
    bl_label = "Add Light Probes"
    bl_options = {"REGISTER", "UNDO"}

    spacing: bpy.props.FloatProperty(
        name="Spacing",
        description="Set the largest distance between neighboring probes",
        options={"SKIP_SAVE"},
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
        try:
            box = room_of(SceneContext(context))
        except EngineError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if box is None:
            self.report({"ERROR"}, "The scene has no visible mesh. Add a mesh first")
            return {"CANCELLED"}
        if not self.properties.is_property_set("spacing"):
            self.spacing = _default_spacing(_widths(box), 1.0 / metres_per_unit(context.scene))
        grids = [filling_grid(width, self.spacing) for width in _widths(box)]
        resolution, widths = [count for count, _ in grids], np.array([width for _, width in grids])
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


def _default_spacing(widths: np.ndarray, metre: float) -> float:
    """Return a spacing of a metre at most that puts nine probes across the narrowest side of a room.

    It is doubled while there are more than `_MANY` probes and it stays within a metre, then while there are
    more probes than a bake supports. Sides below a tenth of the longest do not count.

    widths:  (3,) of the room
    metre:   in the unit of the widths
    """
    narrow = widths[widths >= _NARROW * widths.max()].min()
    spacing = min(metre, narrow / _STEPS)
    while True:
        counts = [filling_grid(width, spacing)[0] for width in widths]
        most = _MANY if 2 * spacing <= metre else MAX_PROBES
        if max(counts) <= MAX_RESOLUTION and math.prod(counts) <= most:
            return spacing
        spacing *= 2


def _widths(box: np.ndarray) -> np.ndarray:
    """Return the widths of a box, (3,), of which none is much smaller than the largest."""
    widths = box[1] - box[0]
    return np.maximum(widths, _FLAT * max(widths.max(), _FLAT))


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
