"""Iterations until the light has settled."""
