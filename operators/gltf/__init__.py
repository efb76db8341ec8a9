"""Exports glTF files with lightmaps through Blender's own exporter."""
