"""Seams between charts, found without a device."""

from engine.patches.chart_edges import chart_edges
from engine.patches.edge_pairs import edge_pairs
from engine.patches.seams import Seams, seams_of
from engine.scene.triangles import Triangles


def find_seams(triangles: Triangles, atlases: int, resolution: int) -> Seams:
    """Return the seams between the charts of the first `atlases` lightmaps.

    Two chart edges form a seam if they coincide and their shading normals are similar. They may belong to one
    object or two, with the same corners or not. A hard edge is no seam.
    """
    edges = chart_edges(triangles, atlases, resolution)
    return seams_of(edges, edge_pairs(edges))
