"""Lightmap UVs for polygon meshes: charts, and where they lie on a page."""
