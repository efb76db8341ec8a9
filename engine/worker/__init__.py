"""Worker process: bakes outside of Blender's process."""
