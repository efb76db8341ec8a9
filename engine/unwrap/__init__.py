"""Lightmap unwrapping of polygon meshes: segmentation into charts, and packing of charts."""
