"""Light to keep."""

import bpy

settings = bpy.context.scene.hemibake

settings.quality = "high"
settings.denoise = False
settings.max_bounces = 50
settings.tolerance = 0.002
settings.texel_samples = "4"
