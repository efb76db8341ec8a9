"""Material nodes -> constants and textures, or a bake by Cycles."""
