"""Converts Blender's lamps and world to the engine's lights and sky."""
