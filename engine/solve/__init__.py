"""Radiosity solver: iterations, Anderson acceleration, patch groups and final gathers."""
