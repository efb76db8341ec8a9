"""Open Image Denoise, as Blender brings it or a Python package does: nothing of it is part of Hemibake."""
