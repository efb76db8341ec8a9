"""Patches: lightmap texels on surfaces, with their geometry, materials and neighbours."""
