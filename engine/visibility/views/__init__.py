"""Viewpoints of patches and sample directions."""
