"""Distributed bakes: Dask workers compute the visibility of blocks of patches, and gather for them.

Only this package imports Dask; `session` imports it if the settings name a scheduler.
"""
