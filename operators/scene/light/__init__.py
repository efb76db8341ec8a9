"""Lamps and the world -> engine lights and sky."""
