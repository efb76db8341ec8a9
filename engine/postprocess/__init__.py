"""Postprocessing of lightmaps: denoising, fit to bilinear lookups and seams, fill of invalid texels."""
