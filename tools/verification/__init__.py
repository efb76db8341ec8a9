"""Hemibake against Cycles, texel by texel."""
