"""Vertex light: the light of a lightmap as colors of a mesh's corners."""
