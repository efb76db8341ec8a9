"""Converts material nodes to constants and textures, or evaluates them by a Cycles bake."""
