"""Choice of methods for a bake: gather, visibility sampler, patch groups and memory."""
