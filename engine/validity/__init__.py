"""Validity: whether a point lies inside geometry, where its light must not be shown."""
