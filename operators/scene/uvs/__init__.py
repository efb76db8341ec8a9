"""Makes lightmap UVs for objects that have none, and checks the lightmap UVs that objects have."""
