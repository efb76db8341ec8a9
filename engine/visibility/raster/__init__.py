"""Hemicubes drawn with OpenGL (paper, IV.B)."""
