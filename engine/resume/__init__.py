"""Checkpoints: intermediate results in files, from which an interrupted bake resumes."""
