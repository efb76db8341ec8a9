"""Light to judge a scene by; a new scene starts with it."""

import bpy

settings = bpy.context.scene.hemibake

settings.quality = "preview"
settings.denoise = False
settings.max_bounces = 50
settings.tolerance = 0.002
settings.texel_samples = "4"
