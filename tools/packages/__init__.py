"""The packages for Blender, one file for each platform."""
