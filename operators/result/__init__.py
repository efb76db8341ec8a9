"""Results of a bake in Blender: images, files and preview materials."""
