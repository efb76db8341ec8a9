"""Gathering: from visibility samples of patches and radiance of what they hit to irradiance."""
