"""Texel encodings of lightmaps for game engines: encoders, decoders and their limits."""
