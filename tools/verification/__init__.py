"""Comparison of Hemibake with Cycles, texel by texel."""
