"""Lightmap texels that lie on surfaces."""
