"""Reflection cubes: radiance cube maps at points, gathered from the solved patches and prefiltered."""
