"""Visibility of patches: samplers by rays or rasterised hemicubes, and their sample patterns."""
