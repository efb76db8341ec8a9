"""Noisy light, soon."""

import bpy

settings = bpy.context.scene.hemibake

settings.quality = "draft"
settings.denoise = True
settings.max_bounces = 50
settings.tolerance = 0.01
settings.texel_samples = "1"
