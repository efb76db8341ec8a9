"""Scenes with hair, which casts shadows as ribbons."""

from __future__ import annotations

import bpy
import numpy as np

from tools.verification.scenes import BY_DESIGN, ORIGINALS, add, floor, lamp, material, scene, world


@scene
def hair_particles():
    """Sparse hair of a legacy particle system on a plate above the floor."""
    floor()
    fur = material("Fur", (0.5, 0.35, 0.2))
    plate = add("Plate", bpy.ops.mesh.primitive_plane_add, fur, size=1.4, location=(0.2, 0.1, 0.4))
    plate.rotation_euler.y = 3.3
    plate.hemibake.role = "NO_LIGHTMAP"
    plate.modifiers.new("Fur", "PARTICLE_SYSTEM")
    settings = plate.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 180, 0.3
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.5, 0.02
    _light()


@scene
def hair_curves():
    """Curves of a comb of bent strands above the floor, with a radius for each point."""
    floor()
    data = bpy.data.hair_curves.new("Comb")
    data.add_curves([5] * 900)
    step = np.arange(5) / 4
    roots = np.random.default_rng(7).uniform(-0.9, 0.9, (900, 2))
    points = np.zeros((900, 5, 3), np.float32)
    points[..., :2] = roots[:, None] + 0.15 * step[:, None] ** 2
    points[..., 2] = 0.5 + 0.4 * step
    data.attributes["position"].data.foreach_set("vector", points.ravel())
    radius = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.tile(0.004 - 0.002 * step, 900).astype(np.float32))
    data.materials.append(material("Strands", (0.3, 0.5, 0.6)))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Comb", data))
    _light()


def _light() -> None:
    lamp("SUN", energy=2.5, angle=0.1)
    world(strength=0.4)


ORIGINALS.update(dict.fromkeys(("hair_particles", "hair_curves"), "Floor"))
BY_DESIGN["hair_curves"] = (3.0, 1.0)
