"""engine.Lightmap -> Blender: images, files, preview materials."""
