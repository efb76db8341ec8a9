"""OpenCL program of patches."""

from __future__ import annotations

from .textured import SAMPLES

#: Distance in texels along u and v from the texel centre within which a point lies inside the texel.
WITHIN = 0.499

#: Kernel files of patches, built as one program: faster than four builds.
SOURCE = ("border_texels.cl", "edge_patches.cl", "list_patches.cl", "texture_means.cl")
OPTIONS = (f"-DWITHIN={WITHIN}f", f"-DSAMPLES={SAMPLES}")
