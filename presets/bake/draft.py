"""Noisy light, soon."""

import bpy

settings = bpy.context.scene.hemibake

settings.quality = "draft"
settings.iterations = 50
settings.tolerance = 0.01
