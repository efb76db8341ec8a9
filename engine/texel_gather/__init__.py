"""Final gather at texel samples, light groups, and the last steps of a lightmap."""
