"""The files that people drag into Blender, one for each platform."""
