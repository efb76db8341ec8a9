"""Scenes of the gallery; the function `build` of each adds it to an empty scene."""
