"""Converts Blender's lights and world to the engine's lights and sky."""
