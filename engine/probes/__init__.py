"""Probe volumes: radiance over the sphere at points in space, as spherical harmonics."""
