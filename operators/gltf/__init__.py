"""glTF files with lightmaps, which Blender's own exporter writes."""
