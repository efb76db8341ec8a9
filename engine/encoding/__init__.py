"""Lightmaps in the formats that engines read: light to bytes and back, and what gets lost."""
