"""Open Image Denoise, loaded from Blender or from a Python package; Hemibake does not ship it."""
