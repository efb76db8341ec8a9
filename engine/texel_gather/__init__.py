"""Light at sample points of texels and of light groups, and the last steps of a lightmap."""
