"""engine.BakeResult -> Blender: images, files, preview materials."""
